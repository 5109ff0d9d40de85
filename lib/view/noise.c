// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Smooth noise and cells over a texture; see noise.h.
 */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include "../base/random.h"
#include "noise.h"

/* 1 over the standard deviation of uniform numbers in ±1 after cubic B-splines both ways. */
#define NORMALIZE 3.61F

struct noise {
	float fade;
	int size, columns, rows;
	double cell_y;
	float *lattice; /* rows × columns */
	float *blend;	/* of four rows of the lattice */
	int *column;	/* first of the four columns of each texel */
	float (*weight)[4];
};

float noise_at(uint64_t seed, int x, int y)
{
	uint64_t place = (uint64_t)(uint32_t)x << 32 | (uint32_t)y;

	seed = incise_random_bits(seed, 0);
	return (float)(incise_random_mix(place + seed) >> 40) * 0x1p-24F;
}

static void spline(float t, float weight[4])
{
	float u = 1 - t;

	weight[0] = u * u * u / 6;
	weight[1] = (3 * t * t * t - 6 * t * t + 4) / 6;
	weight[2] = (3 * u * u * u - 6 * u * u + 4) / 6;
	weight[3] = t * t * t / 6;
}

struct noise *noise_new(uint64_t seed, int size, double cell_x, double cell_y)
{
	struct noise *noise = calloc(1, sizeof(*noise));
	double cell = fmin(cell_x, cell_y);
	size_t n;

	if (!noise)
		return NULL;
	/* A NaN cell has no noise. */
	noise->fade = (float)fmin(fmax((cell - 1.5) / 1.5, 0), 1);
	if (noise->fade <= 0)
		return noise;
	noise->size = size;
	noise->cell_y = cell_y;
	noise->columns = (int)(size / cell_x) + 4;
	noise->rows = (int)(size / cell_y) + 4;
	n = (size_t)noise->columns * (size_t)noise->rows;
	noise->lattice = calloc(n, sizeof(*noise->lattice));
	noise->blend = calloc((size_t)noise->columns, sizeof(*noise->blend));
	noise->column = calloc((size_t)size, sizeof(*noise->column));
	noise->weight = calloc((size_t)size, sizeof(*noise->weight));
	if (!noise->lattice || !noise->blend || !noise->column || !noise->weight) {
		noise_free(noise);
		return NULL;
	}
	for (size_t i = 0; i < n; i++)
		noise->lattice[i] = noise->fade * NORMALIZE *
				    (2 * noise_at(seed, (int)i % noise->columns,
						  (int)i / noise->columns) -
				     1);
	for (int x = 0; x < size; x++) {
		double at = (x + 0.5) / cell_x;

		noise->column[x] = (int)at;
		spline((float)(at - (int)at), noise->weight[x]);
	}
	return noise;
}

void noise_free(struct noise *noise)
{
	if (!noise)
		return;
	free(noise->lattice);
	free(noise->blend);
	free(noise->column);
	free(noise->weight);
	free(noise);
}

void noise_row(struct noise *noise, int y, float gain, float *restrict row)
{
	double at;
	const float *from;
	float weight[4];

	if (noise->fade <= 0)
		return;
	at = (y + 0.5) / noise->cell_y;
	from = noise->lattice + (size_t)(int)at * (size_t)noise->columns;
	spline((float)(at - (int)at), weight);
	for (int i = 0; i < noise->columns; i++)
		noise->blend[i] = gain * (weight[0] * from[i] +
					  weight[1] * from[i + noise->columns] +
					  weight[2] * from[i + 2 * noise->columns] +
					  weight[3] * from[i + 3 * noise->columns]);
	for (int x = 0; x < noise->size; x++) {
		const float *b = noise->blend + noise->column[x], *w = noise->weight[x];

		row[x] += w[0] * b[0] + w[1] * b[1] + w[2] * b[2] + w[3] * b[3];
	}
}

/*
 * Cells: one point in each square of a lattice; the two nearest are searched in 3 × 3 squares.
 *
 *      ┌───┬───┬───┐
 *      │ · │  ·│·  │
 *      ├───┼───┼───┤
 *      │  ·│× ·│  ·│
 *      ├───┼───┼───┤
 *      │·  │ · │·  │
 *      └───┴───┴───┘
 */
/* Squares around the texture, for warps and neighbours. */
#define MARGIN 3

/* Part of a square for its point: cells of a tissue have similar sizes. */
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

static int keep_within_noise(int i, int n)
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
			(keep_within_noise((int)v, cells->rows) - 1) * cells->columns +
			keep_within_noise((int)u, cells->columns) - 1;

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
