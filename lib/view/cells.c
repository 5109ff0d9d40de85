// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Cells as of a tissue.
 *
 *      ┌───┬───┬───┐   one point in each square of a lattice: the two nearest are looked
 *      │ · │  ·│·  │   for in 3 × 3 squares around
 *      ├───┼───┼───┤
 *      │  ·│× ·│  ·│
 *      ├───┼───┼───┤
 *      │·  │ · │·  │
 *      └───┴───┴───┘
 */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include "cells.h"
#include "noise.h"

/* Squares around the texture, for warps and for neighbours. */
#define MARGIN 3

/* Of a square that its point may lie in: cells of a tissue are of about the same size. */
#define SCATTER 0.85F

struct cells {
	float fade;
	int size, columns, rows;
	double cell_x, cell_y;
	float (*point)[2]; /* rows × columns, squares from the lattice's corner */
};

struct cells *cells_new(uint64_t seed, int size, double cell_x, double cell_y)
{
	struct cells *cells = calloc(1, sizeof(*cells));

	if (!cells)
		return NULL;
	cells->size = size;
	cells->fade = (float)fmin(fmax((fmin(cell_x, cell_y) - 2) / 2, 0), 1);
	if (cells->fade <= 0)
		return cells;
	cells->cell_x = cell_x;
	cells->cell_y = cell_y;
	cells->columns = (int)(size / cell_x) + 2 * MARGIN + 1;
	cells->rows = (int)(size / cell_y) + 2 * MARGIN + 1;
	cells->point = calloc((size_t)cells->columns * (size_t)cells->rows,
			      sizeof(*cells->point));
	if (!cells->point) {
		free(cells);
		return NULL;
	}
	for (int y = 0; y < cells->rows; y++)
		for (int x = 0; x < cells->columns; x++) {
			float *point = cells->point[y * cells->columns + x];

			point[0] = (float)x + SCATTER * noise_at(seed, 2 * x, y);
			point[1] = (float)y + SCATTER * noise_at(seed, 2 * x + 1, y);
		}
	return cells;
}

void cells_free(struct cells *cells)
{
	if (!cells)
		return;
	free(cells->point);
	free(cells);
}

float cells_fade(const struct cells *cells)
{
	return cells->fade;
}

static int within(int i, int n)
{
	return i < 1 ? 1 : i > n - 2 ? n - 2 : i;
}

void cells_row(const struct cells *cells, int y, const float *warp_x, const float *warp_y,
	       float *restrict nearest, float *restrict farther)
{
	const float step = cells->fade > 0 ? (float)(1 / cells->cell_x) : 0;
	float top;

	if (cells->fade <= 0) {
		for (int x = 0; x < cells->size; x++) {
			nearest[x] = 0.4F;
			farther[x] = 0.3F;
		}
		return;
	}
	top = (float)((y + 0.5) / cells->cell_y) + MARGIN;
	for (int x = 0; x < cells->size; x++) {
		float u = ((float)x + 0.5F) * step + MARGIN + warp_x[x];
		float v = top + warp_y[x], first = 8, second = 8;
		const float(*point)[2] =
			cells->point +
			(within((int)v, cells->rows) - 1) * cells->columns +
			within((int)u, cells->columns) - 1;

		for (int j = 0; j < 3; j++, point += cells->columns)
			for (int i = 0; i < 3; i++) {
				float dx = point[i][0] - u, dy = point[i][1] - v;
				float d = dx * dx + dy * dy;
				float larger = d > first ? d : first;

				first = d < first ? d : first;
				second = larger < second ? larger : second;
			}
		nearest[x] = sqrtf(first);
		farther[x] = sqrtf(second) - nearest[x];
	}
}
