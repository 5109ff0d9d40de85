// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A grid of heights; see grid.h. Steps stay within 63 bits:
 *
 *   heights            held to ±2^28 by the check; a difference is 2^20 at most, by its slope
 *   rise of two cells  2^21
 *   weights            add up to 2^36; times a rise, or the height of a cell, 2^57
 *   slope              4 in Q24: 2^26
 *   places in the grid 2047 · 2^18 < 2^30; below and above it INCISE_FX_AWAY_MAX, 2^30
 */
#include "grid.h"
#include "layout.h"
#include "vector.h"

#define BAD (-EINVAL)
#define HEIGHT_MAX (1 << 28)
#define SLOPE_BITS 24
#define SETTLED 2 /* a step so short, 30 nm, is rounding */

static bool is_frame(const struct incise_fixed_grid_frame *frame)
{
	int32_t up[3];

	for (int i = 0; i < 3; i++)
		if (!incise_fx_is_unit(frame->axis[i], 3))
			return false;
	incise_fx_cross(up, frame->axis[0], frame->axis[1]);
	for (int i = 0; i < 3; i++) {
		/* With opposite signs they are 2^31 apart. */
		int64_t off = (int64_t)up[i] - frame->axis[2][i];

		if (off > 64 || off < -64)
			return false;
	}
	for (int i = 0; i < 3; i++)
		if (frame->origin[i] > INCISE_FX_AWAY_MAX / 2 ||
		    frame->origin[i] < -INCISE_FX_AWAY_MAX / 2)
			return false;
	return frame->cell_shift >= 8 && frame->cell_shift <= 18 && frame->columns >= 2 &&
	       frame->columns <= INCISE_FIXED_GRID_KNOTS_MAX && frame->rows >= 2 &&
	       frame->rows <= INCISE_FIXED_GRID_KNOTS_MAX && frame->reach >= 0 &&
	       frame->reach <= HEIGHT_MAX &&
	       /* The whole grid lies within the range of places. */
	       (int64_t)(frame->columns - 1) << frame->cell_shift <= INCISE_FX_AWAY_MAX &&
	       (int64_t)(frame->rows - 1) << frame->cell_shift <= INCISE_FX_AWAY_MAX;
}

/* Whether the way from one knot to the next is steeper than heights may be. */
static bool is_cliff(int32_t h, int32_t next, int32_t steepest)
{
	int64_t step = (int64_t)h - incise_fx_int32(next);

	return incise_fx_int32(next) != INCISE_FIXED_GRID_NONE &&
	       (step > steepest || step < -steepest);
}

int incise_fixed_grid_open(struct incise_fixed_grid *grid,
			   const struct incise_fixed_grid_frame *frame,
			   const int32_t *height, uint32_t size)
{
	int32_t steepest;

	if (!is_frame(frame) ||
	    size != (uint32_t)frame->columns * (uint32_t)frame->rows * sizeof(*height))
		return BAD;
	steepest = INCISE_FIXED_GRID_SLOPE_MAX << frame->cell_shift;
	for (int32_t k = 0; k < frame->columns * frame->rows; k++) {
		int32_t h = incise_fx_int32(height[k]);

		if (h == INCISE_FIXED_GRID_NONE)
			continue;
		if (h > HEIGHT_MAX || h < -HEIGHT_MAX)
			return BAD;
		if (k % frame->columns && is_cliff(h, height[k - 1], steepest))
			return BAD;
		if (k >= frame->columns &&
		    is_cliff(h, height[k - frame->columns], steepest))
			return BAD;
	}
	*grid = (struct incise_fixed_grid){.frame = *frame, .height = height};
	return 0;
}

/* The cell of a coordinate, and the place in it. */
static int32_t cell(int32_t at, int32_t knots, int32_t shift, int32_t *fraction)
{
	int32_t i = (int32_t)incise_fx_within(at >> shift, 0, knots - 2);

	*fraction = (int32_t)incise_fx_within(at - (i << shift), 0, 1 << shift);
	return i;
}

/* The rise over two cells around a knot; where there is one only, twice that. */
static int32_t rise(const int32_t *h, int32_t i, int32_t knots, int32_t stride)
{
	int32_t here = incise_fx_int32(*h), before = INCISE_FIXED_GRID_NONE,
		behind = INCISE_FIXED_GRID_NONE;

	if (i > 0)
		before = incise_fx_int32(h[-stride]);
	if (i < knots - 1)
		behind = incise_fx_int32(h[stride]);
	if (before == INCISE_FIXED_GRID_NONE)
		return 2 * (behind - here);
	if (behind == INCISE_FIXED_GRID_NONE)
		return 2 * (here - before);
	return behind - before;
}

/* Height and outward normal, in the grid's own frame, at u, v within it. Returns whether there is one. */
static bool look_grid(const struct incise_fixed_grid *grid, int32_t at[3],
		      int32_t normal[3])
{
	const struct incise_fixed_grid_frame *frame = &grid->frame;
	int32_t shift = frame->cell_shift, one = 1 << shift, fu, fv;
	int32_t i = cell(at[0], frame->columns, shift, &fu);
	int32_t j = cell(at[1], frame->rows, shift, &fv);
	const int32_t *h = grid->height + j * frame->columns + i;
	int64_t height = 0, u = 0, v = 0, up[3];

	/* A cell with a knot without height is a hole: the search ends before it adds. */
	for (int k = 0; k < 4; k++)
		if (incise_fx_int32(h[(k >> 1) * frame->columns + (k & 1)]) ==
		    INCISE_FIXED_GRID_NONE)
			return false;
	for (int k = 0; k < 4; k++) {
		const int32_t *knot = h + (k >> 1) * frame->columns + (k & 1);
		/* 2^18 · 2^18, four of which add up to that; times 2^21 */
		int64_t weight =
			(int64_t)(k & 1 ? fu : one - fu) * (k >> 1 ? fv : one - fv);

		height += weight * (incise_fx_int32(*knot) - incise_fx_int32(*h));
		u += weight * rise(knot, i + (k & 1), frame->columns, 1);
		v += weight * rise(knot, j + (k >> 1), frame->rows, frame->columns);
	}
	/* Slopes over two cells, to Q24. */
	up[0] = -incise_fx_rounded(u, 3 * shift + 1 - SLOPE_BITS);
	up[1] = -incise_fx_rounded(v, 3 * shift + 1 - SLOPE_BITS);
	up[2] = (int64_t)1 << SLOPE_BITS;
	incise_fx_unit(normal, up, 3, 0);
	at[2] = (int32_t)(incise_fx_int32(*h) + incise_fx_rounded(height, 2 * shift));
	return true;
}

/* From the grid's frame: a length along each axis, or a direction. */
static void turn_grid(const struct incise_fixed_grid_frame *frame, const int32_t local[3],
		      int32_t to[3])
{
	for (int i = 0; i < 3; i++) {
		int64_t sum = 0;

		/* 3 · 2^31 · 2^30 < 2^63 */
		for (int k = 0; k < 3; k++)
			sum += (int64_t)local[k] * frame->axis[k][i];
		to[i] = incise_fx_hold32(incise_fx_rounded(sum, 30));
	}
}

/* Whether a place lies within the grid, seen from above. */
static bool is_within(const struct incise_fixed_grid_frame *frame, const int32_t at[3])
{
	return at[0] >= 0 && at[0] <= (frame->columns - 1) << frame->cell_shift &&
	       at[1] >= 0 && at[1] <= (frame->rows - 1) << frame->cell_shift;
}

/* A step on. Returns whether it went anywhere. */
static bool go_grid(const struct incise_fixed_grid_frame *frame, int32_t at[3],
		    const int32_t tool[3], int32_t depth, const int32_t normal[3])
{
	int32_t most = frame->reach + frame->reach / 4, next[3];

	incise_fx_add(next, tool, (int32_t)incise_fx_hold(depth, most), normal);
	/* The way may leave the grid, but not end there. */
	next[0] = (int32_t)incise_fx_within(next[0], 0,
					    (frame->columns - 1) << frame->cell_shift);
	next[1] = (int32_t)incise_fx_within(next[1], 0,
					    (frame->rows - 1) << frame->cell_shift);
	if (incise_fx_hold(next[0] - at[0], SETTLED) == next[0] - at[0] &&
	    incise_fx_hold(next[1] - at[1], SETTLED) == next[1] - at[1])
		return false;
	incise_fx_copy(at, next);
	return true;
}

bool incise_fixed_grid_nearest(const struct incise_fixed_grid *grid, const int32_t p[3],
			       struct incise_fixed_spot *spot)
{
	const struct incise_fixed_grid_frame *frame = &grid->frame;
	int32_t off[3], tool[3], at[3], normal[3], depth;

	incise_fx_sub(off, p, frame->origin);
	for (int i = 0; i < 3; i++)
		tool[i] = incise_fx_along(off, frame->axis[i]);
	if (!is_within(frame, tool))
		return false;
	incise_fx_copy(at, tool);
	for (int k = 0;; k++) {
		if (!look_grid(grid, at, normal))
			return false;
		incise_fx_sub(off, at, tool);
		depth = incise_fx_along(off, normal);
		if (k == INCISE_FIXED_GRID_STEPS ||
		    !go_grid(frame, at, tool, depth, normal))
			break;
	}
	/* Beyond the edge there is nothing. */
	incise_fx_add(off, tool, depth, normal);
	if (depth < -frame->reach || !is_within(frame, off))
		return false;
	/* Too deep for the heights: the force does not end there, but does not grow. */
	spot->depth = depth < frame->reach ? depth : frame->reach;
	turn_grid(frame, normal, spot->normal);
	turn_grid(frame, at, spot->point);
	for (int i = 0; i < 3; i++)
		spot->point[i] =
			incise_fx_hold32((int64_t)spot->point[i] + frame->origin[i]);
	return true;
}
