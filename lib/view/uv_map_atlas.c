// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The map of a mesh's own texture coordinates. Cells over the texture, each with a list of the
 * triangles that touch it, find the triangle of a texel.
 *
 *      ┌────┬────┬────┐
 *      │  ╱╲│    │    │     triangles without an area there, or outside the texture, are
 *      ├─╱──┼╲───┼────┤     drawn but not found
 *      │╱___│_╲  │    │
 *      └────┴────┴────┘
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "../surface/surface.h"
#include "uv_map.h"

#define CELLS_MAX 256

/* If triangles are in more cells than this on average, cells become larger. */
#define ENTRIES_PER_TRIANGLE 8

/* Smaller triangles have no area, texels². */
#define AREA_MIN 1e-9

/* Rounding may put a place on an edge outside of both triangles. */
#define BESIDE 1e-6

struct uv_atlas {
	int cells;	    /* per side */
	size_t *first;	    /* of each cell, in `triangle`; and an end */
	uint32_t *triangle; /* of the mesh, by cell */
};

/* A triangle in texels, with its corners and the derivatives of its points. */
struct patch {
	double px[3][2], area2;
	double corner[3][3], right[3], down[3]; /* mm; mm per texel */
};

static void corner_px(const struct uv_map *map, uint32_t triangle, int corner,
		      double px[2])
{
	const float *uv = map->surface->mesh->uv[triangle][corner];

	px[0] = (double)uv[0] * map->size;
	px[1] = (1 - (double)uv[1]) * map->size;
}

/* False: it contains no texel. */
static bool patch_read(const struct uv_map *map, uint32_t triangle, struct patch *patch)
{
	const struct mesh *mesh = map->surface->mesh;
	double f1[2], f2[2], e1[3], e2[3], least[2], most[2];

	for (int k = 0; k < 3; k++) {
		corner_px(map, triangle, k, patch->px[k]);
		v3_copy(patch->corner[k], mesh->vertex[mesh->corner[triangle][k]]);
	}
	for (int i = 0; i < 2; i++) {
		f1[i] = patch->px[1][i] - patch->px[0][i];
		f2[i] = patch->px[2][i] - patch->px[0][i];
		least[i] = fmin(fmin(patch->px[0][i], patch->px[1][i]), patch->px[2][i]);
		most[i] = fmax(fmax(patch->px[0][i], patch->px[1][i]), patch->px[2][i]);
		if (!(least[i] < map->size && most[i] > 0))
			return false;
	}
	patch->area2 = f1[0] * f2[1] - f1[1] * f2[0];
	if (!(fabs(patch->area2) > 2 * AREA_MIN))
		return false;
	v3_sub(e1, patch->corner[1], patch->corner[0]);
	v3_sub(e2, patch->corner[2], patch->corner[0]);
	for (int i = 0; i < 3; i++) {
		patch->right[i] = (e1[i] * f2[1] - e2[i] * f1[1]) / patch->area2;
		patch->down[i] = (e2[i] * f1[0] - e1[i] * f2[0]) / patch->area2;
	}
	return true;
}

/* The least of the three weights of a texel; < 0 outside. */
static double inside(const struct patch *patch, const double px[2])
{
	double least = 1;

	for (int k = 0; k < 3; k++) {
		const double *a = patch->px[(k + 1) % 3], *b = patch->px[(k + 2) % 3];
		double weight = ((a[0] - px[0]) * (b[1] - px[1]) -
				 (a[1] - px[1]) * (b[0] - px[0])) /
				patch->area2;

		least = fmin(least, weight);
	}
	return least;
}

static int cell_of(const struct uv_map *map, int cells, double px)
{
	return (int)fmin(fmax(px * cells / map->size, 0), cells - 1);
}

/* The cells that a triangle may touch: columns from [0] to [1], rows from [2] to [3]. */
static void reach(const struct uv_map *map, int cells, const struct patch *patch,
		  int box[4])
{
	const double margin = 1e-3;

	for (int i = 0; i < 2; i++) {
		const double a = patch->px[0][i], b = patch->px[1][i],
			     c = patch->px[2][i];

		box[2 * i] = cell_of(map, cells, fmin(fmin(a, b), c) - margin);
		box[2 * i + 1] = cell_of(map, cells, fmax(fmax(a, b), c) + margin);
	}
}

/* The mean size of the texture on the surface, as a square. Returns the number of triangles. */
static uint32_t measure_uv_map_atlas(struct uv_map *map)
{
	double mm2 = 0, px2 = 0;
	struct patch patch;
	uint32_t n = 0;

	for (uint32_t t = 0; t < map->surface->mesh->n_triangles; t++) {
		double normal[3];

		if (!patch_read(map, t, &patch))
			continue;
		v3_cross(normal, patch.right, patch.down);
		px2 += fabs(patch.area2);
		mm2 += fabs(patch.area2) * v3_length(normal);
		n++;
	}
	if (n)
		map->wide_mm = map->high_mm = map->size * sqrt(mm2 / px2);
	map->right[0] = map->up[2] = 1;
	map->down[1] = -1;
	return n;
}

/*
 * Enter each triangle into the lists of its cells; without lists yet, count them in first[cell + 1].
 * False: they are too many.
 */
static bool enter_all(const struct uv_map *map, struct uv_atlas *atlas)
{
	size_t most = (size_t)ENTRIES_PER_TRIANGLE * map->surface->mesh->n_triangles;
	int cells = atlas->cells;
	size_t n = 0;

	for (uint32_t t = 0; t < map->surface->mesh->n_triangles; t++) {
		struct patch patch;
		int box[4];

		if (!patch_read(map, t, &patch))
			continue;
		reach(map, cells, &patch, box);
		n += (size_t)(box[1] - box[0] + 1) * (size_t)(box[3] - box[2] + 1);
		if (n > most)
			return false;
		for (int y = box[2]; y <= box[3]; y++)
			for (int x = box[0]; x <= box[1]; x++)
				if (atlas->triangle)
					atlas->triangle[atlas->first[y * cells + x]++] =
						t;
				else
					atlas->first[y * cells + x + 1]++;
	}
	return true;
}

static int make_lists(struct uv_map *map, uint32_t n)
{
	struct uv_atlas *atlas = map->atlas;
	size_t *first;

	atlas->cells = (int)fmin(fmax(sqrt(n), 1), CELLS_MAX);
	first = calloc((size_t)atlas->cells * (size_t)atlas->cells + 1, sizeof(*first));
	atlas->first = first;
	if (!first)
		return -ENOMEM;
	/* A single cell has each triangle once: that is few enough. */
	while (!enter_all(map, atlas)) {
		memset(first, 0,
		       ((size_t)atlas->cells * atlas->cells + 1) * sizeof(*first));
		atlas->cells = (atlas->cells + 1) / 2;
	}
	n = (uint32_t)(atlas->cells * atlas->cells);
	for (uint32_t i = 0; i < n; i++)
		first[i + 1] += first[i];
	atlas->triangle = calloc(first[n] + 1, sizeof(*atlas->triangle));
	if (!atlas->triangle)
		return -ENOMEM;
	/* Then first[cell] is the end of the cell's list: shift it back. */
	enter_all(map, atlas);
	memmove(first + 1, first, n * sizeof(*first));
	first[0] = 0;
	return 0;
}

int uv_atlas_init(struct uv_map *map)
{
	uint32_t n = measure_uv_map_atlas(map);

	if (!n)
		return 0;
	map->kind = UV_MAP_ATLAS;
	map->atlas = calloc(1, sizeof(*map->atlas));
	if (!map->atlas)
		return -ENOMEM;
	return make_lists(map, n);
}

void uv_atlas_free(struct uv_atlas *atlas)
{
	if (!atlas)
		return;
	free(atlas->first);
	free(atlas->triangle);
	free(atlas);
}

bool uv_atlas_px(const struct uv_map *map, const double point_mm[3], double px[2])
{
	struct incise_touch touch;
	double at[2];

	incise_surface_nearest(map->surface, point_mm, &touch);
	/* Faces without texture coordinates have 0, 0 at all corners. */
	if (touch.uv[0] == 0 && touch.uv[1] == 0)
		return false;
	at[0] = touch.uv[0] * map->size;
	at[1] = (1 - touch.uv[1]) * map->size;
	if (!(at[0] >= 0 && at[0] <= map->size && at[1] >= 0 && at[1] <= map->size))
		return false;
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

/* The triangle of a texel; among several the one with the largest inside(). */
static bool find_uv_map_atlas(const struct uv_map *map, const double px[2],
			      struct patch *found, uint32_t *triangle)
{
	const struct uv_atlas *atlas = map->atlas;
	size_t cell = (size_t)cell_of(map, atlas->cells, px[1]) * (size_t)atlas->cells +
		      (size_t)cell_of(map, atlas->cells, px[0]);
	double best = -BESIDE;
	bool any = false;

	for (size_t i = atlas->first[cell]; i < atlas->first[cell + 1]; i++) {
		struct patch patch;
		double in;

		if (!patch_read(map, atlas->triangle[i], &patch))
			continue;
		in = inside(&patch, px);
		if (!(in >= best) || (any && in == best))
			continue;
		best = in;
		*found = patch;
		*triangle = atlas->triangle[i];
		any = true;
	}
	return any;
}

bool uv_atlas_point(const struct uv_map *map, const double px[2], double point_mm[3],
		    double normal[3])
{
	const struct mesh *mesh = map->surface->mesh;
	double e1[3], e2[3], out[3];
	struct patch patch;
	uint32_t triangle;

	if (!find_uv_map_atlas(map, px, &patch, &triangle))
		return false;
	v3_add(point_mm, patch.corner[0], px[0] - patch.px[0][0], patch.right);
	v3_add(point_mm, point_mm, px[1] - patch.px[0][1], patch.down);
	v3_sub(e1, patch.corner[1], patch.corner[0]);
	v3_sub(e2, patch.corner[2], patch.corner[0]);
	v3_cross(out, e1, e2);
	if (!v3_unit(normal, out, 0))
		v3_copy(normal, mesh->normal[mesh->corner[triangle][0]]);
	return true;
}

bool uv_atlas_metric(const struct uv_map *map, const double px[2], double right_mm[3],
		     double down_mm[3])
{
	struct patch patch;
	uint32_t triangle;

	if (!find_uv_map_atlas(map, px, &patch, &triangle))
		return false;
	v3_copy(right_mm, patch.right);
	v3_copy(down_mm, patch.down);
	return true;
}

/* --- The triangles: the mesh's own. At seams, a corner of the mesh is several vertices. --- */

/* Compare at most so many vertices of one place; beyond, equal ones may occur twice. */
#define COMPARED_MAX 16

struct weld {
	uint32_t *last;	  /* newest vertex for each of the mesh's, or MESH_NONE */
	uint32_t *before; /* the previous vertex for the same one, or MESH_NONE */
	uint32_t *corner; /* 3 · triangle + corner, the first of each vertex */
};

static const float *uv_of(const struct mesh *mesh, uint32_t corner)
{
	return mesh->uv[corner / 3][corner % 3];
}

static uint32_t weld_corner(struct weld *weld, const struct mesh *mesh, uint32_t corner,
			    int *n)
{
	uint32_t point = mesh->corner[corner / 3][corner % 3];
	uint32_t vertex = weld->last[point];

	for (int k = 0; k < COMPARED_MAX && vertex != MESH_NONE; k++) {
		const float *a = uv_of(mesh, corner);
		const float *b = uv_of(mesh, weld->corner[vertex]);

		if (a[0] == b[0] && a[1] == b[1])
			return vertex;
		vertex = weld->before[vertex];
	}
	vertex = (uint32_t)(*n)++;
	weld->corner[vertex] = corner;
	weld->before[vertex] = weld->last[point];
	weld->last[point] = vertex;
	return vertex;
}

/* The directions of +px[0] and +px[1] over each triangle, summed at its corners. */
static void add_directions(struct uv_map *map, double (*right)[3], double (*down)[3])
{
	for (int i = 0; i < map->n_indices; i += 3) {
		const struct uv_map_vertex *v[3];
		double e1[3], e2[3], f1[2], f2[2], turn;

		for (int k = 0; k < 3; k++)
			v[k] = map->vertices + map->indices[i + k];
		for (int k = 0; k < 3; k++) {
			e1[k] = (double)v[1]->position_mm[k] - v[0]->position_mm[k];
			e2[k] = (double)v[2]->position_mm[k] - v[0]->position_mm[k];
		}
		for (int k = 0; k < 2; k++) {
			f1[k] = (double)v[1]->px[k] - v[0]->px[k];
			f2[k] = (double)v[2]->px[k] - v[0]->px[k];
		}
		turn = f1[0] * f2[1] - f1[1] * f2[0] < 0 ? -1 : 1;
		for (int k = 0; k < 3; k++) {
			double *r = right[map->indices[i + k]];
			double *d = down[map->indices[i + k]];

			v3_add(r, r, turn * f2[1], e1);
			v3_add(r, r, -turn * f1[1], e2);
			v3_add(d, d, turn * f1[0], e2);
			v3_add(d, d, -turn * f2[0], e1);
		}
	}
}

static void set_tangent(struct uv_map_vertex *vertex, const double right[3],
			const double down[3])
{
	double normal[3], side[3], tangent[3] = {1, 0, 0}, out[3];

	for (int k = 0; k < 3; k++)
		normal[k] = vertex->normal[k];
	if (fabs(normal[0]) > 0.9) {
		tangent[0] = 0;
		tangent[1] = 1;
	}
	v3_add(side, right, -v3_dot(right, normal), normal);
	/* Without texture coordinates, use any tangent. */
	if (!v3_unit(tangent, side, 0)) {
		v3_add(side, tangent, -v3_dot(tangent, normal), normal);
		v3_unit(tangent, side, 0);
	}
	v3_cross(out, normal, tangent);
	for (int k = 0; k < 3; k++)
		vertex->tangent[k] = (float)tangent[k];
	vertex->tangent[3] = v3_dot(out, down) > 0 ? 1 : -1;
}

static int write_vertices(struct uv_map *map, const struct weld *weld)
{
	const struct mesh *mesh = map->surface->mesh;
	size_t n = (size_t)map->n_vertices;
	double(*right)[3] = calloc(n, sizeof(*right));
	double(*down)[3] = calloc(n, sizeof(*down));
	int rc = right && down ? 0 : -ENOMEM;

	map->vertices = calloc(n, sizeof(*map->vertices));
	if (!map->vertices)
		rc = -ENOMEM;
	for (size_t i = 0; i < n && !rc; i++) {
		struct uv_map_vertex *to = map->vertices + i;
		uint32_t corner = weld->corner[i];
		uint32_t point = mesh->corner[corner / 3][corner % 3];
		const float *uv = uv_of(mesh, corner);

		for (int k = 0; k < 3; k++) {
			to->position_mm[k] = (float)mesh->vertex[point][k];
			to->normal[k] = (float)mesh->normal[point][k];
		}
		to->px[0] = uv[0] * (float)map->size;
		to->px[1] = (float)((1 - (double)uv[1]) * map->size);
	}
	if (!rc)
		add_directions(map, right, down);
	for (size_t i = 0; i < n && !rc; i++)
		set_tangent(map->vertices + i, right[i], down[i]);
	free(right);
	free(down);
	return rc;
}

int uv_atlas_mesh(struct uv_map *map)
{
	const struct mesh *mesh = map->surface->mesh;
	size_t n = 3 * (size_t)mesh->n_triangles;
	struct weld weld = {0};
	int rc = -ENOMEM;

	map->indices = calloc(n, sizeof(*map->indices));
	weld.last = malloc(mesh->n_vertices * sizeof(*weld.last));
	weld.before = malloc(n * sizeof(*weld.before));
	weld.corner = malloc(n * sizeof(*weld.corner));
	if (map->indices && weld.last && weld.before && weld.corner) {
		for (uint32_t i = 0; i < mesh->n_vertices; i++)
			weld.last[i] = MESH_NONE;
		for (size_t i = 0; i < n; i++)
			map->indices[i] =
				weld_corner(&weld, mesh, (uint32_t)i, &map->n_vertices);
		map->n_indices = (int)n;
		rc = write_vertices(map, &weld);
	}
	free(weld.last);
	free(weld.before);
	free(weld.corner);
	return rc;
}
