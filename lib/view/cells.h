/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Cells as of a tissue (Worley 1996): scattered points, and of each texel the distance to
 * the two that are nearest.
 */
#ifndef INCISE_CELLS_H
#define INCISE_CELLS_H

#include <stdbool.h>
#include <stdint.h>

struct cells;

/* @cell_x, @cell_y in texels, on average; less than 2: there are none. NULL: no memory. */
struct cells *cells_new(uint64_t seed, int size, double cell_x, double cell_y);
void cells_free(struct cells *cells);

/* How clearly they are seen: 0 where there are none, 1 from 4 texels on. */
float cells_fade(const struct cells *cells);

/*
 * Of a row of texels, each moved by (warp_x, warp_y) cells, ±2 at most: the distance to
 * the nearest point and how much farther the next is, in cells; about 0.4 and 0.3 on
 * average. Where there are no cells just this.
 */
void cells_row(const struct cells *cells, int y, const float *warp_x, const float *warp_y,
	       float *nearest, float *farther);

#endif
