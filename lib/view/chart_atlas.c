// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A chart of a mesh's own texture coordinates. The triangle that a texel is in is found by
 * cells over the texture, each with a list of the triangles that touch it.
 *
 *      ┌────┬────┬────┐
 *      │  ╱╲│    │    │     what has no area there, or lies beside the texture, is drawn
 *      ├─╱──┼╲───┼────┤     and not found
 *      │╱___│_╲  │    │
 *      └────┴────┴────┘
 */
#include <errno.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../surface/surface.h"
#include "chart_kind.h"

#define CELLS_MAX 256

/* Triangles that lie in many cells each: then cells are made larger. */
#define ENTRIES_PER_TRIANGLE 8

/* Less than this is no area, texels². */
#define AREA_MIN 1e-9

/* Rounding puts a place on an edge between two triangles beside both. */
#define BESIDE 1e-6

struct chart_atlas {
	int cells;	    /* a side */
	size_t *first;	    /* of each cell, in `triangle`; one more at the end */
	uint32_t *triangle; /* of the mesh, by cell */
};

/* A triangle in texels, and how its points and texels belong together. */
struct patch {
	double px[3][2], area2;
	double corner[3][3], right[3], down[3]; /* mm; mm per texel */
};

static void corner_px(const struct incise_chart *chart, uint32_t triangle, int corner,
		      double px[2])
{
	const float *uv = chart->surface->mesh->uv[triangle][corner];

	px[0] = (double)uv[0] * chart->size;
	px[1] = (1 - (double)uv[1]) * chart->size;
}

/* False: no texel is in it. */
static bool patch_read(const struct incise_chart *chart, uint32_t triangle,
		       struct patch *patch)
{
	const struct mesh *mesh = chart->surface->mesh;
	double f1[2], f2[2], e1[3], e2[3], least[2], most[2];

	for (int k = 0; k < 3; k++) {
		corner_px(chart, triangle, k, patch->px[k]);
		v3_copy(patch->corner[k], mesh->vertex[mesh->corner[triangle][k]]);
	}
	for (int i = 0; i < 2; i++) {
		f1[i] = patch->px[1][i] - patch->px[0][i];
		f2[i] = patch->px[2][i] - patch->px[0][i];
		least[i] = fmin(fmin(patch->px[0][i], patch->px[1][i]), patch->px[2][i]);
		most[i] = fmax(fmax(patch->px[0][i], patch->px[1][i]), patch->px[2][i]);
		if (!(least[i] < chart->size && most[i] > 0))
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

/* How far a texel is inside: the least of its three weights; < 0 outside. */
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

static int cell_of(const struct incise_chart *chart, int cells, double px)
{
	return (int)fmin(fmax(px * cells / chart->size, 0), cells - 1);
}

/* The cells that a triangle may touch: columns from [0] to [1], rows from [2] to [3]. */
static void reach(const struct incise_chart *chart, int cells, const struct patch *patch,
		  int box[4])
{
	const double margin = 1e-3;

	for (int i = 0; i < 2; i++) {
		const double a = patch->px[0][i], b = patch->px[1][i],
			     c = patch->px[2][i];

		box[2 * i] = cell_of(chart, cells, fmin(fmin(a, b), c) - margin);
		box[2 * i + 1] = cell_of(chart, cells, fmax(fmax(a, b), c) + margin);
	}
}

/* How large the texture is on the surface, as a square, for what is as on flat ground. */
static uint32_t measure(struct incise_chart *chart)
{
	double mm2 = 0, px2 = 0;
	struct patch patch;
	uint32_t n = 0;

	for (uint32_t t = 0; t < chart->surface->mesh->n_triangles; t++) {
		double normal[3];

		if (!patch_read(chart, t, &patch))
			continue;
		v3_cross(normal, patch.right, patch.down);
		px2 += fabs(patch.area2);
		mm2 += fabs(patch.area2) * v3_length(normal);
		n++;
	}
	if (n)
		chart->wide_mm = chart->high_mm = chart->size * sqrt(mm2 / px2);
	chart->right[0] = chart->up[2] = 1;
	chart->down[1] = -1;
	return n;
}

/* Counts into first[cell + 1]; whether they are few enough. */
static bool count(const struct incise_chart *chart, struct chart_atlas *atlas, int cells)
{
	size_t most = (size_t)ENTRIES_PER_TRIANGLE * chart->surface->mesh->n_triangles;
	size_t n = 0;

	atlas->cells = cells;
	for (int i = 0; i <= cells * cells; i++)
		atlas->first[i] = 0;
	for (uint32_t t = 0; t < chart->surface->mesh->n_triangles; t++) {
		struct patch patch;
		int box[4];

		if (!patch_read(chart, t, &patch))
			continue;
		reach(chart, cells, &patch, box);
		n += (size_t)(box[1] - box[0] + 1) * (size_t)(box[3] - box[2] + 1);
		if (n > most)
			return false;
		for (int y = box[2]; y <= box[3]; y++)
			for (int x = box[0]; x <= box[1]; x++)
				atlas->first[y * cells + x + 1]++;
	}
	return true;
}

/* Into the lists; then first[cell] is the end of a cell's own, and is put back. */
static void fill(const struct incise_chart *chart, struct chart_atlas *atlas)
{
	int cells = atlas->cells;

	for (uint32_t t = 0; t < chart->surface->mesh->n_triangles; t++) {
		struct patch patch;
		int box[4];

		if (!patch_read(chart, t, &patch))
			continue;
		reach(chart, cells, &patch, box);
		for (int y = box[2]; y <= box[3]; y++)
			for (int x = box[0]; x <= box[1]; x++)
				atlas->triangle[atlas->first[y * cells + x]++] = t;
	}
	for (int i = cells * cells; i > 0; i--)
		atlas->first[i] = atlas->first[i - 1];
	atlas->first[0] = 0;
}

static int make_lists(struct incise_chart *chart, uint32_t n)
{
	struct chart_atlas *atlas = chart->atlas;
	int cells = (int)fmin(fmax(sqrt(n), 1), CELLS_MAX);

	atlas->first = calloc((size_t)cells * (size_t)cells + 1, sizeof(*atlas->first));
	if (!atlas->first)
		return -ENOMEM;
	/* One cell has each triangle once: that is few enough. */
	while (!count(chart, atlas, cells))
		cells = (cells + 1) / 2;
	for (int i = 0; i < cells * cells; i++)
		atlas->first[i + 1] += atlas->first[i];
	atlas->triangle =
		calloc(atlas->first[cells * cells] + 1, sizeof(*atlas->triangle));
	if (!atlas->triangle)
		return -ENOMEM;
	fill(chart, atlas);
	return 0;
}

int chart_atlas_init(struct incise_chart *chart)
{
	uint32_t n = measure(chart);

	if (!n)
		return 0;
	chart->kind = CHART_ATLAS;
	chart->atlas = calloc(1, sizeof(*chart->atlas));
	if (!chart->atlas)
		return -ENOMEM;
	return make_lists(chart, n);
}

void chart_atlas_free(struct chart_atlas *atlas)
{
	if (!atlas)
		return;
	free(atlas->first);
	free(atlas->triangle);
	free(atlas);
}

bool chart_atlas_px(const struct incise_chart *chart, const double point_mm[3],
		    double px[2])
{
	struct incise_touch touch;
	double at[2];

	incise_surface_nearest(chart->surface, point_mm, &touch);
	/* Faces without texture coordinates have 0, 0 at all corners. */
	if (touch.uv[0] == 0 && touch.uv[1] == 0)
		return false;
	at[0] = touch.uv[0] * chart->size;
	at[1] = (1 - touch.uv[1]) * chart->size;
	if (!(at[0] >= 0 && at[0] <= chart->size && at[1] >= 0 && at[1] <= chart->size))
		return false;
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

/* The triangle that a texel is in; of several the one that it is most inside of. */
static bool find(const struct incise_chart *chart, const double px[2],
		 struct patch *found, uint32_t *triangle)
{
	const struct chart_atlas *atlas = chart->atlas;
	size_t cell = (size_t)cell_of(chart, atlas->cells, px[1]) * (size_t)atlas->cells +
		      (size_t)cell_of(chart, atlas->cells, px[0]);
	double best = -BESIDE;
	bool any = false;

	for (size_t i = atlas->first[cell]; i < atlas->first[cell + 1]; i++) {
		struct patch patch;
		double in;

		if (!patch_read(chart, atlas->triangle[i], &patch))
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

bool chart_atlas_point(const struct incise_chart *chart, const double px[2],
		       double point_mm[3], double normal[3])
{
	const struct mesh *mesh = chart->surface->mesh;
	double e1[3], e2[3], out[3];
	struct patch patch;
	uint32_t triangle;

	if (!find(chart, px, &patch, &triangle))
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

bool chart_atlas_metric(const struct incise_chart *chart, const double px[2],
			double right_mm[3], double down_mm[3])
{
	struct patch patch;
	uint32_t triangle;

	if (!find(chart, px, &patch, &triangle))
		return false;
	v3_copy(right_mm, patch.right);
	v3_copy(down_mm, patch.down);
	return true;
}
