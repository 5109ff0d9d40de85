/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Random patterns over a texture: noise and cells, row by row, and noise at single places. All are
 * functions of seed and place: the same seed gives the same bits on one type of machine.
 */
#ifndef INCISE_VIEW_NOISE_H
#define INCISE_VIEW_NOISE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/*
 * Smooth noise: random numbers on a lattice, cubic B-splines between them. A row of the lattice is
 * blended first, so that a texel costs four products whatever the cell's size. Mean 0, standard
 * deviation about 1, within ±4.
 */
struct noise;

/*
 * @size of the texture; cells in texels. Cells below 3 texels fade, and vanish at 1.5, which costs
 * nothing. NULL: no memory.
 */
struct noise *noise_new(uint64_t seed, int size, double cell_x, double cell_y);
void noise_free(struct noise *noise);

/* Add gain × noise to a row; y from 0 to size - 1. For one thread: it buffers a row. */
void noise_row(struct noise *noise, int y, float gain, float *row);

/* A number from 0 to 1, less than 1, for a place of a lattice. */
float noise_at(uint64_t seed, int x, int y);

/*
 * Cells as of a tissue (Worley 1996): scattered points, and for each texel the distances to the two
 * nearest.
 */
struct cells;

/* @cell_x, @cell_y: mean size in texels; below 2 there are no cells. NULL: no memory. */
struct cells *cells_new(uint64_t seed, int size, double cell_x, double cell_y);
void cells_free(struct cells *cells);

/* Contrast: 0 without cells, 1 from 4 texels on. */
float cells_fade(const struct cells *cells);

/*
 * For each texel of a row, moved by (warp_x, warp_y) cells, ±2 at most: the distance to the nearest
 * point, and the additional distance to the next, in cells; on average, and without cells, about
 * 0.4 and 0.3.
 */
void cells_row(const struct cells *cells, int y, const float *warp_x, const float *warp_y,
	       float *nearest, float *farther);

/* -1 … 1 at a point of a grid; cheap, for pixels. */
static inline float noise_grid(uint32_t key, int x, int y)
{
	uint32_t h = key ^ ((uint32_t)x * 0x8da6b343u) ^ ((uint32_t)y * 0xd8163841u);

	h = (h ^ (h >> 15)) * 0x2c1b3c6du;
	h = (h ^ (h >> 12)) * 0x297a2d39u;
	h ^= h >> 15;
	return (float)(h >> 8) * (2.0f / 16777216.0f) - 1.0f;
}

/* -1 … 1, smooth between the points of a grid; x and y within ±1e9. */
static inline float noise_smooth(uint32_t key, float x, float y)
{
	float fx = floorf(x), fy = floorf(y);
	int ix = (int)fx, iy = (int)fy;
	float u = x - fx, v = y - fy;
	float a, b;

	u = u * u * (3 - 2 * u);
	v = v * v * (3 - 2 * v);
	a = noise_grid(key, ix, iy) * (1 - u) + noise_grid(key, ix + 1, iy) * u;
	b = noise_grid(key, ix, iy + 1) * (1 - u) + noise_grid(key, ix + 1, iy + 1) * u;
	return a * (1 - v) + b * v;
}

/* The same for n points of a row, x_step apart from the first on. */
static inline void noise_smooth_row(uint32_t key, float x_step, int first, float y, int n,
				    float *to)
{
	float fy = floorf(y), v = y - fy, left = 0, right = 0;
	int iy = (int)fy, cell = 0;
	bool any = false;

	v = v * v * (3 - 2 * v);
	for (int i = 0; i < n; i++) {
		float x = (float)(first + i) * x_step, fx = floorf(x), u = x - fx;

		if (!any || (int)fx != cell) {
			cell = (int)fx;
			any = true;
			left = noise_grid(key, cell, iy) * (1 - v) +
			       noise_grid(key, cell, iy + 1) * v;
			right = noise_grid(key, cell + 1, iy) * (1 - v) +
				noise_grid(key, cell + 1, iy + 1) * v;
		}
		u = u * u * (3 - 2 * u);
		to[i] = left * (1 - u) + right * u;
	}
}

#endif
