// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a reader's points and triangles to a mesh:
 *
 *   weld equal points ─▶ check areas ─▶ find neighbours ─▶ tree of boxes, whose order the
 *   triangles take ─▶ number the fans around points: they are the vertices
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "mesh.h"

struct mesh_builder {
	const struct mesh_draft *draft;
	uint32_t n;
	uint32_t (*corner)[3];	  /* welded points, in the draft's order */
	uint32_t (*neighbour)[3]; /* in the draft's order */
	struct mesh *mesh;
	struct incise_error *err;
};

static int no_memory(const struct mesh_builder *b)
{
	return incise_error_set(b->err, ENOMEM, "%s: no memory for its %u triangles",
				b->draft->path, b->n);
}

static int line_of(const struct mesh_builder *b, uint32_t face)
{
	return b->draft->line ? b->draft->line[face] : 0;
}

struct located {
	double point[3];
	uint32_t index;
};

static int compare_located(const void *a, const void *b)
{
	const struct located *p = a, *q = b;

	for (int i = 0; i < 3; i++)
		if (p->point[i] != q->point[i])
			return p->point[i] < q->point[i] ? -1 : 1;
	return p->index < q->index ? -1 : p->index > q->index;
}

/* Points with equal coordinates become the first one of them. */
static int weld(struct mesh_builder *b)
{
	size_t n = b->draft->n_points;
	struct located *sorted = malloc(n * sizeof(*sorted));
	uint32_t *first = malloc(n * sizeof(*first));

	if (!sorted || !first) {
		free(sorted);
		free(first);
		return no_memory(b);
	}
	for (size_t k = 0; k < n; k++) {
		v3_copy(sorted[k].point, b->draft->point[k]);
		sorted[k].index = (uint32_t)k;
	}
	qsort(sorted, n, sizeof(*sorted), compare_located);
	for (size_t k = 0; k < n; k++) {
		const struct located *before = sorted + (k ? k - 1 : 0);
		bool equal = k && before->point[0] == sorted[k].point[0] &&
			     before->point[1] == sorted[k].point[1] &&
			     before->point[2] == sorted[k].point[2];

		first[sorted[k].index] = equal ? first[before->index] : sorted[k].index;
	}
	for (uint32_t face = 0; face < b->n; face++)
		for (int i = 0; i < 3; i++)
			b->corner[face][i] = first[b->draft->corner[face][i]];
	free(sorted);
	free(first);
	return 0;
}

static int check_areas(const struct mesh_builder *b)
{
	for (uint32_t face = 0; face < b->n; face++) {
		const double *corner[3];
		double n[3], longest = 0;

		for (int i = 0; i < 3; i++)
			corner[i] = b->draft->point[b->corner[face][i]];
		triangle_area_normal(n, corner[0], corner[1], corner[2]);
		for (int i = 0; i < 3; i++)
			longest = fmax(longest,
				       v3_distance2(corner[i], corner[(i + 1) % 3]));
		if (v3_length(n) > MESH_HEIGHT_MIN_MM * sqrt(longest))
			continue;
		return incise_error_set(
			b->err, EINVAL,
			"%s:%d: a triangle without area (its corners coincide or lie on "
			"one line); remove it",
			b->draft->path, line_of(b, face));
	}
	return 0;
}

/* A side of a triangle, kept with the smaller of its two points. */
struct side {
	uint32_t other; /* point */
	uint32_t face;
	uint32_t edge : 2, down : 1; /* it runs from the larger to the smaller point */
};

static int compare_sides(const void *a, const void *b)
{
	const struct side *s = a, *t = b;

	if (s->other != t->other)
		return s->other < t->other ? -1 : 1;
	return s->face < t->face ? -1 : s->face > t->face;
}

/* Sides of one point, sorted: two with the same other point are an edge. */
static int pair_sides(struct mesh_builder *b, const struct side *side, uint32_t n)
{
	for (uint32_t k = 0; k + 1 < n; k++) {
		const struct side *s = side + k, *t = s + 1;

		if (s->other != t->other)
			continue;
		if (k + 2 < n && side[k + 2].other == s->other)
			return incise_error_set(
				b->err, EINVAL,
				"%s:%d: an edge of this face has more than two "
				"triangles, one of them of line %d; part them",
				b->draft->path, line_of(b, side[k + 2].face),
				line_of(b, s->face));
		if (s->down == t->down)
			return incise_error_set(
				b->err, EINVAL,
				"%s:%d: this face turns the other way than its "
				"neighbour of line %d; make all turn "
				"counter-clockwise seen from outside",
				b->draft->path, line_of(b, t->face), line_of(b, s->face));
		b->neighbour[s->face][s->edge] = t->face;
		b->neighbour[t->face][t->edge] = s->face;
		k++;
	}
	return 0;
}

static int find_neighbours(struct mesh_builder *b)
{
	size_t n_points = b->draft->n_points;
	uint32_t *end = calloc(n_points + 1, sizeof(*end));
	struct side *side = malloc(3 * (size_t)b->n * sizeof(*side));
	int rc = 0;

	if (!end || !side) {
		free(end);
		free(side);
		return no_memory(b);
	}
	memset(b->neighbour, 0xff, b->n * sizeof(*b->neighbour)); /* MESH_NONE */
	/* How many sides each point has, where they begin, and at last where they end. */
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			uint32_t p = b->corner[face][i], q = b->corner[face][(i + 1) % 3];

			end[(p < q ? p : q) + 1]++;
		}
	}
	for (size_t k = 0; k < n_points; k++)
		end[k + 1] += end[k];
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			uint32_t p = b->corner[face][i], q = b->corner[face][(i + 1) % 3];
			bool down = p > q;

			side[end[down ? q : p]++] = (struct side){.other = down ? p : q,
								  .face = face,
								  .edge = i,
								  .down = down};
		}
	}
	for (size_t k = 0; k < n_points && !rc; k++) {
		struct side *begin = side + (k ? end[k - 1] : 0);
		uint32_t n = end[k] - (k ? end[k - 1] : 0);

		qsort(begin, n, sizeof(*begin), compare_sides);
		rc = pair_sides(b, begin, n);
	}
	free(end);
	free(side);
	return rc;
}

/* Build the tree, and take over the triangles in its order. */
static int order_triangles(struct mesh_builder *b)
{
	struct mesh *mesh = b->mesh;
	float(*box)[2][3] = malloc(b->n * sizeof(*box));
	uint32_t *place = malloc(b->n * sizeof(*place));

	if (!box || !place)
		goto no_memory;
	for (uint32_t face = 0; face < b->n; face++) {
		for (int i = 0; i < 3; i++) {
			double lo = INFINITY, hi = -INFINITY;

			for (int k = 0; k < 3; k++) {
				double x = b->draft->point[b->corner[face][k]][i];

				lo = fmin(lo, x);
				hi = fmax(hi, x);
			}
			box[face][0][i] = bvh_outwards(lo, 0);
			box[face][1][i] = bvh_outwards(hi, 1);
		}
	}
	if (bvh_build(&mesh->bvh, (const float(*)[2][3])box, b->n, mesh->number))
		goto no_memory;
	for (uint32_t k = 0; k < b->n; k++)
		place[mesh->number[k]] = k;
	for (uint32_t k = 0; k < b->n; k++) {
		uint32_t face = mesh->number[k];

		memcpy(mesh->corner[k], b->corner[face], sizeof(*mesh->corner));
		for (int i = 0; i < 3; i++) {
			uint32_t other = b->neighbour[face][i];

			mesh->neighbour[k][i] = other == MESH_NONE ? other : place[other];
		}
		if (mesh->uv)
			memcpy(mesh->uv[k], b->draft->uv[face], sizeof(*mesh->uv));
	}
	free(box);
	free(place);
	return 0;
no_memory:
	free(box);
	free(place);
	return no_memory(b);
}

/* The angle of a triangle at its corner a, and the normal of its face. */
static double angle_at(const double *a, const double *b, const double *c, double n[3])
{
	double ab[3], ac[3], area[3];

	v3_sub(ab, b, a);
	v3_sub(ac, c, a);
	v3_cross(area, ab, ac);
	v3_unit(n, area, 0);
	return atan2(v3_length(area), v3_dot(ab, ac));
}

/* Give the fan around a corner of a face its vertex. */
static void new_vertex(struct mesh_builder *b, uint32_t face, int i, uint32_t *vertex_of)
{
	struct mesh *mesh = b->mesh;
	uint32_t point = mesh->corner[face][i], vertex = mesh->n_vertices++;
	struct mesh_fan fan = mesh_fan(face, point);
	double sum[3] = {0}, n[3];
	uint32_t other;

	v3_copy(mesh->vertex[vertex], b->draft->point[point]);
	while (mesh_fan_face(mesh, &fan, &other)) {
		int k = mesh_corner_of(mesh, other, point);
		const uint32_t *c = mesh->corner[other];
		double angle =
			angle_at(b->draft->point[point], b->draft->point[c[(k + 1) % 3]],
				 b->draft->point[c[(k + 2) % 3]], n);

		v3_add(sum, sum, angle, n);
		vertex_of[3 * (size_t)other + k] = vertex;
	}
	/* Faces that cancel have no middle: the last one's, then. */
	v3_unit(n, sum, 1e-12);
	v3_copy(mesh->normal[vertex], n);
}

static int number_vertices(struct mesh_builder *b)
{
	struct mesh *mesh = b->mesh;
	size_t n_corners = 3 * (size_t)b->n;
	uint32_t *vertex_of = malloc(n_corners * sizeof(*vertex_of));
	void *vertex, *normal;

	mesh->vertex = malloc(n_corners * sizeof(*mesh->vertex));
	mesh->normal = malloc(n_corners * sizeof(*mesh->normal));
	if (!vertex_of || !mesh->vertex || !mesh->normal) {
		free(vertex_of);
		return no_memory(b);
	}
	memset(vertex_of, 0xff, n_corners * sizeof(*vertex_of));
	for (size_t k = 0; k < n_corners; k++)
		if (vertex_of[k] == MESH_NONE)
			new_vertex(b, (uint32_t)(k / 3), k % 3, vertex_of);
	memcpy(mesh->corner, vertex_of, n_corners * sizeof(*vertex_of));
	free(vertex_of);
	/* Most meshes have half as many vertices as triangles. */
	vertex = realloc(mesh->vertex, mesh->n_vertices * sizeof(*mesh->vertex));
	if (vertex)
		mesh->vertex = vertex;
	normal = realloc(mesh->normal, mesh->n_vertices * sizeof(*mesh->normal));
	if (normal)
		mesh->normal = normal;
	return 0;
}

struct mesh *mesh_new(const struct mesh_draft *draft, struct incise_error *err)
{
	struct mesh_builder b = {.draft = draft, .err = err};
	struct mesh *mesh;
	size_t n = draft->n_triangles;
	int rc;

	if (!n) {
		incise_error_set(err, EINVAL, "%s: no triangle: expected at least one",
				 draft->path);
		return NULL;
	}
	if (n > INCISE_SURFACE_TRIANGLES_MAX) {
		incise_error_set(err, E2BIG, "%s: %zu triangles, at most %d can be held",
				 draft->path, n, INCISE_SURFACE_TRIANGLES_MAX);
		return NULL;
	}
	b.n = (uint32_t)n;
	mesh = b.mesh = calloc(1, sizeof(*mesh));
	b.corner = malloc(n * sizeof(*b.corner));
	b.neighbour = malloc(n * sizeof(*b.neighbour));
	if (mesh) {
		mesh->n_triangles = b.n;
		mesh->corner = malloc(n * sizeof(*mesh->corner));
		mesh->neighbour = malloc(n * sizeof(*mesh->neighbour));
		mesh->number = malloc(n * sizeof(*mesh->number));
		if (draft->uv)
			mesh->uv = malloc(n * sizeof(*mesh->uv));
	}
	if (!mesh || !b.corner || !b.neighbour || !mesh->corner || !mesh->neighbour ||
	    !mesh->number || (draft->uv && !mesh->uv))
		rc = no_memory(&b);
	else
		rc = weld(&b);
	if (!rc)
		rc = check_areas(&b);
	if (!rc)
		rc = find_neighbours(&b);
	if (!rc)
		rc = order_triangles(&b);
	if (!rc)
		rc = number_vertices(&b);
	free(b.corner);
	free(b.neighbour);
	if (rc) {
		mesh_free(mesh);
		errno = -rc;
		return NULL;
	}
	return mesh;
}
