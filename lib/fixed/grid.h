/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * A grid of heights over a plane: a surface without overhangs, whose nearest point is found in a
 * bounded number of steps.
 *
 *      up ▲      ● knots, 2^cell_shift LSB apart
 *         │   ●╌╌╌●╌╌╌●      height: bilinear between them
 *         └────────────▶ u    (v across)
 *      origin
 *
 * The normal is bilinear too, between the slopes over two cells around each knot, so that it has no
 * leap between cells. From the place below or above the tool the nearest point is found by going from
 * the tool along the normal there, and again from where that leads: as long as the depth is less than
 * the radius of curvature each step leaves a part of the last step only. lib/scene/heights.h makes
 * grids with a certified bound.
 *
 *        ╲  x₀         tool + depth(xₖ) × normal(xₖ) = xₖ₊₁
 *         ╲ ┊  x₁
 *          ╲┊ ╱
 *           ○╱         until a step is rounding, or there were INCISE_FIXED_GRID_STEPS
 *         tool
 *
 *   lengths Q16.16 mm     axes Q2.30     slopes Q24
 */
#ifndef INCISE_FIXED_GRID_H
#define INCISE_FIXED_GRID_H

#include <incise/export.h>
#include "integers.h"

#define INCISE_FIXED_GRID_KNOTS_MAX 2048 /* per side */
#define INCISE_FIXED_GRID_SLOPE_MAX 4	 /* of a cell: 76° */
#define INCISE_FIXED_GRID_STEPS 24
#define INCISE_FIXED_GRID_NONE \
	INT32_MIN /* the height of a knot where there is no surface */

/* The numbers of a grid, as they stand in a plan. */
struct incise_fixed_grid_frame {
	int32_t origin[3];
	int32_t axis[3][3];    /* u, v, up: right-handed, at right angles */
	int32_t cell_shift;    /* 8 … 18: 0.004 … 4 mm */
	int32_t columns, rows; /* knots along u and v, 2 … INCISE_FIXED_GRID_KNOTS_MAX */
	int32_t reach; /* farther outside there is nothing; deeper counts as that deep */
};

struct incise_fixed_grid {
	struct incise_fixed_grid_frame frame;
	const int32_t
		*height; /* rows × columns, little-endian; or INCISE_FIXED_GRID_NONE */
};

/* A place of the grid. */
struct incise_fixed_spot {
	int32_t point[3], normal[3];
	int32_t depth;
};

/*
 * Check a grid in full: ranges, axes, the size of the heights and their slopes.
 *
 * @param size of the heights in bytes
 * @return 0, -22 (EINVAL)
 */
int incise_fixed_grid_open(struct incise_fixed_grid *grid,
			   const struct incise_fixed_grid_frame *frame,
			   const int32_t *height, uint32_t size);

/*
 * Find the nearest point. Returns whether there is a point: not beyond the edge, in a hole, or beyond
 * the reach.
 */
bool incise_fixed_grid_nearest(const struct incise_fixed_grid *grid, const int32_t p[3],
			       struct incise_fixed_spot *spot) INCISE_REALTIME;

#endif
