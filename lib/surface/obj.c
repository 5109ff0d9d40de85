// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a file of triangles: a Wavefront OBJ, or an STL, text or binary.
 *
 * From an OBJ: `v`, `vt` and `f`. A face's corner is v, v/vt, v//vn or
 * v/vt/vn, counted from 1, or from -1 backwards for the last one before the face. Normals
 * (`vn`) are counted, so that their indices can be checked, and not used: a proxy needs
 * the ones of the faces.
 *
 * A face refers to vertices before it. A face with more corners is cut into a fan from its
 * first corner. Statements that hold no surface are passed over; unknown statements, and
 * other descriptions of a surface, are errors.
 *
 * From an STL: each facet has three corners of its own, which the mesh welds. A facet with
 * two equal corners is no part of the surface. Normals are not used. In messages on a binary
 * one the number of the facet, from 1, stands for the line.
 *
 *     binary   80 bytes │ n, uint32 │ n × (12 floats: normal, 3 corners │ 2 bytes)
 */
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include "../base/grow.h"
#include "../base/text.h"
#include "mesh.h"

#define UV_NONE UINT32_MAX
#define STL_HEAD 84
#define STL_FACET 50
#define POINTS_MAX (3 * (size_t)INCISE_SURFACE_TRIANGLES_MAX)

struct index {
	uint32_t v, vt;
};

struct obj {
	struct text text;
	struct incise_error *err;
	const double *at_mm;
	size_t n_vt, n_vn, capacity_v, capacity_vt, capacity_corner, capacity_index,
		capacity_line;
	float (*vt)[2];
	uint32_t (*index)[3]; /* of vt, per triangle */
	bool textured;
	struct mesh_draft draft;
};

/* Room for one more of @each bytes. */
static int grow_obj(struct obj *obj, void *array, size_t n, size_t *capacity, size_t each)
{
	return grow_array(array, n, capacity, 1024, each)
		       ? 0
		       : incise_error_set(obj->err, ENOMEM, "%s: no memory to read it",
					  obj->text.path);
}

static int too_many(struct obj *obj, const char *what, size_t most)
{
	return incise_error_set(obj->err, E2BIG, "%s:%d: more than %zu %s",
				obj->text.path, obj->text.line, most, what);
}

/* The line's numbers, from @least to @most; those that are left out stay as they are. */
static int numbers(struct obj *obj, const char *what, int least, int most, double *value)
{
	const char *word;
	size_t length;
	int n = 0;

	while ((length = text_word(&obj->text, &word)) && *word != '#') {
		if (n == most)
			return text_error(&obj->text, obj->err,
					  "%s with more than %d numbers", what, most);
		if (!text_number(word, length, value + n++))
			return text_error(&obj->text, obj->err,
					  "%s: '%.*s' is not a number", what,
					  (int)(length < 40 ? length : 40), word);
	}
	if (n < least)
		return text_error(&obj->text, obj->err, "%s with %d numbers, not %d",
				  what, n, least);
	return 0;
}

static int add_point(struct obj *obj, const char *what, const double value[3])
{
	struct mesh_draft *draft = &obj->draft;
	int rc = 0;

	if (draft->n_points == POINTS_MAX)
		rc = too_many(obj, "points", POINTS_MAX);
	if (!rc)
		rc = grow_obj(obj, &draft->point, draft->n_points, &obj->capacity_v,
			      sizeof(*draft->point));
	if (rc)
		return rc;
	for (int i = 0; i < 3; i++) {
		double x = value[i] + obj->at_mm[i];

		if (!(fabs(x) <= MESH_COORDINATE_MAX_MM))
			return text_error(&obj->text, obj->err,
					  "%s: %g mm is farther than %g mm from the "
					  "origin; check that its unit is mm",
					  what, x, MESH_COORDINATE_MAX_MM);
		/* A sum with +0 is never -0, so that equal ones compare equal. */
		draft->point[draft->n_points][i] = x + 0.0;
	}
	draft->n_points++;
	return 0;
}

static int read_point(struct obj *obj)
{
	double value[7]; /* some writers add a weight, or a colour */
	int rc = numbers(obj, "v", 3, 7, value);

	return rc ? rc : add_point(obj, "v", value);
}

static int read_uv(struct obj *obj)
{
	double value[3] = {0};
	int rc = numbers(obj, "vt", 1, 3, value);

	if (!rc && obj->n_vt == POINTS_MAX)
		rc = too_many(obj, "texture coordinates", POINTS_MAX);
	if (!rc)
		rc = grow_obj(obj, &obj->vt, obj->n_vt, &obj->capacity_vt,
			      sizeof(*obj->vt));
	if (rc)
		return rc;
	for (int i = 0; i < 2; i++) {
		if (!(fabs(value[i]) <= 1e6))
			return text_error(&obj->text, obj->err,
					  "vt: %g is not a texture coordinate", value[i]);
		obj->vt[obj->n_vt][i] = (float)value[i];
	}
	obj->n_vt++;
	return 0;
}

/* One index of a corner; @at goes behind it. */
static int read_index(struct obj *obj, const char **at, const char *end, const char *what,
		      size_t n, uint32_t *index)
{
	long long value = 0;
	const char *word = *at;

	*at = text_integer(word, end, &value);
	if (!*at)
		return text_error(&obj->text, obj->err, "f: '%.*s' is not an index",
				  (int)(end - word < 40 ? end - word : 40), word);
	if (!value || value > (long long)n || -value > (long long)n)
		return text_error(&obj->text, obj->err,
				  "f: no %s %lld among the %zu before this line", what,
				  value, n);
	*index = (uint32_t)(value > 0 ? value - 1 : (long long)n + value);
	return 0;
}

static int read_corner(struct obj *obj, const char *word, size_t length,
		       struct index *corner)
{
	const char *at = word, *end = word + length;
	uint32_t vn;
	int rc = read_index(obj, &at, end, "v", obj->draft.n_points, &corner->v);

	corner->vt = UV_NONE;
	if (!rc && at < end && *at == '/') {
		at++;
		/* Some writers leave the slashes of indices that there are not: 1/ and 1//. */
		if (at < end && *at != '/') {
			obj->textured = true;
			rc = read_index(obj, &at, end, "vt", obj->n_vt, &corner->vt);
		}
		if (!rc && at < end && *at == '/') {
			at++;
			if (at < end)
				rc = read_index(obj, &at, end, "vn", obj->n_vn, &vn);
		}
	}
	if (!rc && at != end)
		return text_error(&obj->text, obj->err,
				  "f: '%.*s': expected v, v/vt, v//vn or v/vt/vn",
				  (int)(length < 40 ? length : 40), word);
	return rc;
}

static int add_triangle(struct obj *obj, const struct index corner[3])
{
	struct mesh_draft *draft = &obj->draft;
	size_t n = draft->n_triangles;
	int rc = 0;

	if (n == INCISE_SURFACE_TRIANGLES_MAX)
		rc = too_many(obj, "triangles", n);
	if (!rc)
		rc = grow_obj(obj, &draft->corner, n, &obj->capacity_corner,
			      sizeof(*draft->corner));
	if (!rc)
		rc = grow_obj(obj, &obj->index, n, &obj->capacity_index,
			      sizeof(*obj->index));
	if (!rc)
		rc = grow_obj(obj, &draft->line, n, &obj->capacity_line,
			      sizeof(*draft->line));
	if (rc)
		return rc;
	for (int i = 0; i < 3; i++) {
		draft->corner[n][i] = corner[i].v;
		obj->index[n][i] = corner[i].vt;
	}
	draft->line[n] = obj->text.line;
	draft->n_triangles++;
	return 0;
}

static int read_face(struct obj *obj)
{
	struct index corner[3]; /* the first, the one before, this */
	const char *word;
	size_t length;
	int n = 0, rc;

	while ((length = text_word(&obj->text, &word)) && *word != '#') {
		rc = read_corner(obj, word, length, corner + (n < 2 ? n : 2));
		if (!rc && n >= 2) {
			rc = add_triangle(obj, corner);
			corner[1] = corner[2];
		}
		if (rc)
			return rc;
		n += n < 3;
	}
	if (n < 3)
		return text_error(&obj->text, obj->err,
				  "f with %d corners: expected 3 or more", n);
	return 0;
}

static bool is_one_of(const char *word, size_t length, const char *const *names, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (strlen(names[i]) == length && !strncasecmp(names[i], word, length))
			return true;
	return false;
}

static void skip_line(struct obj *obj)
{
	const char *word;

	while (text_word(&obj->text, &word))
		;
}

static int read_obj_line(struct obj *obj)
{
	/* Names, materials, display, lines and points. */
	static const char *const others[] = {
		"g",   "o",	 "s",	   "mg",       "usemtl",     "mtllib",
		"lod", "usemap", "maplib", "bevel",    "shadow_obj", "trace_obj",
		"l",   "p",	 "vp",	   "c_interp", "d_interp"};
	const char *word;
	size_t length = text_word(&obj->text, &word);

	if (!length || *word == '#')
		return 0;
	if (length == 1 && *word == 'v')
		return read_point(obj);
	if (length == 1 && *word == 'f')
		return read_face(obj);
	if (length == 2 && !memcmp(word, "vt", 2))
		return read_uv(obj);
	if (length == 2 && !memcmp(word, "vn", 2)) {
		double value[3];

		obj->n_vn++;
		return numbers(obj, "vn", 3, 3, value);
	}
	if (is_one_of(word, length, others, sizeof(others) / sizeof(*others))) {
		skip_line(obj);
		return 0;
	}
	return text_error(&obj->text, obj->err,
			  "'%.*s' is no statement of an OBJ that is read; correct it, or "
			  "remove the line if it holds no part of the surface",
			  (int)(length < 40 ? length : 40), word);
}

static int add_facet(struct obj *obj, double (*value)[3])
{
	uint32_t n = (uint32_t)obj->draft.n_points;
	const struct index corner[3] = {{n, UV_NONE}, {n + 1, UV_NONE}, {n + 2, UV_NONE}};
	int rc = 0;

	for (int i = 0; i < 3; i++)
		if (!memcmp(value[i], value[(i + 1) % 3], sizeof(*value)))
			return 0;
	for (int i = 0; i < 3 && !rc; i++)
		rc = add_point(obj, "vertex", value[i]);
	return rc ? rc : add_triangle(obj, corner);
}

static uint32_t word_of(const char *bytes)
{
	uint32_t word;

	memcpy(&word, bytes, sizeof(word));
	return le32toh(word);
}

static int read_binary_stl(struct obj *obj)
{
	const char *at = obj->text.data + STL_HEAD;
	int rc = 0;

	for (obj->text.line = 1; !rc && at < obj->text.end; at += STL_FACET) {
		double value[3][3];

		for (int i = 0; i < 9; i++) {
			uint32_t bits = word_of(at + 12 + 4 * i);
			float number;

			memcpy(&number, &bits, sizeof(number));
			value[i / 3][i % 3] = number;
		}
		rc = add_facet(obj, value);
		obj->text.line++;
	}
	return rc;
}

static int read_text_stl(struct obj *obj)
{
	static const char *const others[] = {"solid", "facet", "outer", "endloop",
					     "endsolid"};
	double value[3][3];
	int n = 0, rc = 0;

	do {
		const char *word;
		size_t length = text_word(&obj->text, &word);

		if (!length || is_one_of(word, length, others, 5)) {
			skip_line(obj); /* names and normals */
		} else if (is_one_of(word, length, (const char *[]){"vertex"}, 1) &&
			   n < 3) {
			rc = numbers(obj, "vertex", 3, 3, value[n++]);
		} else if (is_one_of(word, length, (const char *[]){"endfacet"}, 1) &&
			   n == 3) {
			rc = add_facet(obj, value);
			n = 0;
		} else {
			return text_error(&obj->text, obj->err,
					  "'%.*s' after %d corners of a facet",
					  (int)(length < 40 ? length : 40), word, n);
		}
	} while (!rc && text_next_line(&obj->text));
	if (!rc && n)
		return text_error(&obj->text, obj->err, "the file ends within a facet");
	return rc;
}

/* A file by its content. Formats that are not read are named. */
static int read_any(struct obj *obj)
{
	static const char *const others[][2] = {{"ply", "a PLY file"},
						{"OFF", "an OFF file"},
						{"# vtk", "a VTK file"},
						{"glTF", "a glTF file"},
						{"PK\003\004",
						 "a 3MF file or an archive"}};
	const struct text *text = &obj->text;
	size_t size = (size_t)(text->end - text->data), length;
	struct text copy = *text;
	const char *word;
	int rc;

	if (size >= STL_HEAD &&
	    size - STL_HEAD == (uint64_t)STL_FACET * word_of(text->data + STL_HEAD - 4))
		return read_binary_stl(obj);
	if (text_next_word(&copy, &word, &length) && length == 5 &&
	    !strncasecmp(word, "solid", 5))
		return read_text_stl(obj);
	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		if (!strncmp(text->at, others[i][0], strlen(others[i][0])))
			return incise_error_set(
				obj->err, EINVAL,
				"%s: this is %s; convert it to STL or OBJ", text->path,
				others[i][1]);
	do {
		rc = read_obj_line(obj);
	} while (!rc && text_next_line(&obj->text));
	return rc;
}

/* Texture coordinates of each triangle's corners; 0, 0 for a triangle without. */
static int take_uv(struct obj *obj)
{
	struct mesh_draft *draft = &obj->draft;
	size_t n = draft->n_triangles;

	if (!obj->textured || !n)
		return 0;
	draft->uv = calloc(n, sizeof(*draft->uv));
	if (!draft->uv)
		return incise_error_set(obj->err, ENOMEM, "%s: no memory to read it",
					obj->text.path);
	for (size_t k = 0; k < n; k++)
		for (int i = 0; i < 3; i++)
			if (obj->index[k][i] != UV_NONE)
				memcpy(draft->uv[k][i], obj->vt[obj->index[k][i]],
				       sizeof(draft->uv[k][i]));
	return 0;
}

struct mesh *obj_load(const char *path, const double at_mm[3], bool cavity,
		      struct incise_error *err)
{
	struct obj obj = {
		.err = err, .at_mm = at_mm, .draft = {.path = path, .cavity = cavity}};
	struct mesh *mesh = NULL;
	int rc = text_open(&obj.text, path, err);

	if (!rc)
		rc = read_any(&obj);
	if (!rc)
		rc = take_uv(&obj);
	text_close(&obj.text);
	if (!rc) {
		mesh = mesh_new(&obj.draft, err);
		rc = mesh ? 0 : -errno;
	}
	free(obj.vt);
	free(obj.index);
	free(obj.draft.point);
	free(obj.draft.corner);
	free(obj.draft.line);
	free(obj.draft.uv);
	if (rc)
		errno = -rc;
	return mesh;
}
