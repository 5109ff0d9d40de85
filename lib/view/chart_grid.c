// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The triangles of a chart: a grid over its texture, 100 × 100 cells of two.
 *
 *      ●──●──●──●     ● a place of the surface
 *      │ ╱│ ╱│ ╱│
 *      ●──●──●──◌     ◌ beside it: drawn towards a neighbour until it is on the surface
 *      │ ╱│ ╱
 *      ●──◌
 */
#include <errno.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "chart_kind.h"

#define CELLS 100
#define SIDE (CELLS + 1)

/* Halvings of a cell on the way to the border: less than a thousandth of a texel. */
#define HALVINGS 24

struct grid {
	const struct incise_chart *chart;
	bool *there;
	double (*px)[2], (*drawn)[3], (*normal)[3];
	uint32_t *number; /* of the vertex */
};

static bool place(struct grid *grid, int i, const double px[2])
{
	double point[3];

	if (!incise_chart_point(grid->chart, px, point, grid->normal[i]))
		return false;
	v3_add(grid->drawn[i], point, incise_chart_relief_mm(grid->chart, px),
	       grid->normal[i]);
	grid->px[i][0] = px[0];
	grid->px[i][1] = px[1];
	return true;
}

static void corner_px(const struct grid *grid, int x, int y, double px[2])
{
	px[0] = (double)grid->chart->size * x / CELLS;
	px[1] = (double)grid->chart->size * y / CELLS;
}

/* On the way from a place of the surface to one beside it, the last one on it. */
static void to_border(struct grid *grid, int i, const double on[2], const double off[2])
{
	double in = 0, out = 1, px[2];

	for (int k = 0; k < HALVINGS; k++) {
		double mid = (in + out) / 2;

		px[0] = on[0] + mid * (off[0] - on[0]);
		px[1] = on[1] + mid * (off[1] - on[1]);
		if (place(grid, i, px))
			in = mid;
		else
			out = mid;
	}
	if (in == 0)
		place(grid, i, on);
}

static void place_all(struct grid *grid)
{
	static const int around[8][2] = {{1, 0}, {0, 1},  {-1, 0},  {0, -1},
					 {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
	double px[2], on[2];

	for (int i = 0; i < SIDE * SIDE; i++) {
		corner_px(grid, i % SIDE, i / SIDE, px);
		grid->there[i] = place(grid, i, px);
	}
	/* `there` is not changed here: only true neighbours are drawn to. */
	for (int i = 0; i < SIDE * SIDE; i++) {
		grid->number[i] = grid->there[i] ? 0 : UINT32_MAX;
		for (int k = 0; k < 8 && grid->number[i]; k++) {
			int x = i % SIDE + around[k][0], y = i / SIDE + around[k][1];

			if (x < 0 || x >= SIDE || y < 0 || y >= SIDE ||
			    !grid->there[y * SIDE + x])
				continue;
			corner_px(grid, i % SIDE, i / SIDE, px);
			corner_px(grid, x, y, on);
			to_border(grid, i, on, px);
			grid->number[i] = 0;
		}
	}
}

/* A neighbour, or the vertex itself where there is none. */
static const double *beside(const struct grid *grid, int i, int dx, int dy)
{
	int x = i % SIDE + dx, y = i / SIDE + dy;

	if (x < 0 || x >= SIDE || y < 0 || y >= SIDE ||
	    grid->number[y * SIDE + x] == UINT32_MAX)
		return grid->drawn[i];
	return grid->drawn[y * SIDE + x];
}

/* Of what is drawn: facets of a mesh smoothed, relief followed. */
static void drawn_normal(const struct grid *grid, int i, double normal[3])
{
	double right[3], down[3], out[3];

	v3_sub(right, beside(grid, i, 1, 0), beside(grid, i, -1, 0));
	v3_sub(down, beside(grid, i, 0, 1), beside(grid, i, 0, -1));
	v3_cross(out, down, right);
	if (!v3_unit(normal, out, 0))
		v3_copy(normal, grid->normal[i]);
}

static bool raised(const struct grid *grid, int i)
{
	const double *px = grid->px[i];
	double cell = (double)grid->chart->size / CELLS;

	/* Its neighbours lie at most so far. */
	for (int k = -1; k <= 1; k++)
		if (incise_chart_relief_mm(grid->chart,
					   (double[2]){px[0] + k * cell, px[1]}) > 1e-6 ||
		    incise_chart_relief_mm(grid->chart,
					   (double[2]){px[0], px[1] + k * cell}) > 1e-6)
			return true;
	return false;
}

static void write_vertex(const struct grid *grid, int i, struct incise_chart_vertex *to)
{
	bool faceted = incise_surface_triangles(grid->chart->surface) > 0;
	double normal[3], right[3], down[3], side[3], tangent[3];

	if (faceted || raised(grid, i))
		drawn_normal(grid, i, normal);
	else
		v3_copy(normal, grid->normal[i]);
	incise_chart_metric(grid->chart, grid->px[i], right, down);
	v3_add(side, right, -v3_dot(right, normal), normal);
	if (!v3_unit(tangent, side, 0))
		v3_copy(tangent, grid->chart->right);
	for (int k = 0; k < 3; k++) {
		to->position_mm[k] = (float)grid->drawn[i][k];
		to->normal[k] = (float)normal[k];
		to->tangent[k] = (float)tangent[k];
	}
	/* normal × right points up. */
	to->tangent[3] = -1;
	to->px[0] = (float)grid->px[i][0];
	to->px[1] = (float)grid->px[i][1];
}

static void write_triangle(const struct grid *grid, struct incise_chart *chart, int a,
			   int b, int c)
{
	/* One corner at least is where it should be, or the triangle is a sliver. */
	if (!grid->there[a] && !grid->there[b] && !grid->there[c])
		return;
	if (grid->number[a] == UINT32_MAX || grid->number[b] == UINT32_MAX ||
	    grid->number[c] == UINT32_MAX)
		return;
	chart->indices[chart->n_indices++] = grid->number[a];
	chart->indices[chart->n_indices++] = grid->number[b];
	chart->indices[chart->n_indices++] = grid->number[c];
}

static void write_all(struct grid *grid, struct incise_chart *chart)
{
	for (int i = 0; i < SIDE * SIDE; i++)
		if (grid->number[i] != UINT32_MAX) {
			write_vertex(grid, i, chart->vertices + chart->n_vertices);
			grid->number[i] = (uint32_t)chart->n_vertices++;
		}
	for (int i = 0; i < SIDE * (SIDE - 1); i++)
		if (i % SIDE < CELLS) {
			write_triangle(grid, chart, i, i + SIDE, i + 1);
			write_triangle(grid, chart, i + 1, i + SIDE, i + SIDE + 1);
		}
}

int chart_grid_init(struct incise_chart *chart)
{
	const size_t n = SIDE * SIDE;
	struct grid grid = {.chart = chart};
	int rc = -ENOMEM;

	grid.there = calloc(n, sizeof(*grid.there));
	grid.px = calloc(n, sizeof(*grid.px));
	grid.drawn = calloc(n, sizeof(*grid.drawn));
	grid.normal = calloc(n, sizeof(*grid.normal));
	grid.number = calloc(n, sizeof(*grid.number));
	chart->vertices = calloc(n, sizeof(*chart->vertices));
	chart->indices = calloc(6 * CELLS * CELLS, sizeof(*chart->indices));
	if (grid.there && grid.px && grid.drawn && grid.normal && grid.number &&
	    chart->vertices && chart->indices) {
		place_all(&grid);
		write_all(&grid, chart);
		rc = 0;
	}
	free(grid.there);
	free(grid.px);
	free(grid.drawn);
	free(grid.normal);
	free(grid.number);
	return rc;
}
