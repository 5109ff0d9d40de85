/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A patch of a grid's support, block a × block b, and what its derivatives can be there:
 * enclosed by interval arithmetic, so that nothing within the patch escapes.
 *
 *   xb ▲
 *      │   ┌──────┐
 *      │   │patch │ b     f1 = ∂F/∂a, f2 = ∂F/∂b, f11 = ∂²F/∂a², f22 = ∂²F/∂b²
 *      │   └──────┘
 *      └──────a──────▶ xa
 */
#ifndef INCISE_PATCH_H
#define INCISE_PATCH_H

#include "grid.h"

/* A part of one input's support. */
struct incise_block {
	struct interval x;
	struct incise_axis_range range;
	int main; /* function with the largest degree in the middle */
};

struct incise_patch {
	struct interval t[INCISE_FIXED_MFS_MAX];  /* T(i) - T(main), see patch.c */
	struct interval t2[INCISE_FIXED_MFS_MAX]; /* T(i)'' */
	struct interval h[INCISE_FIXED_MFS_MAX];  /* h(i) - h(main) */
	struct interval f1, f2, f11, f22;
};

void incise_block_over(struct incise_block *block, const struct incise_axis *axis,
		       struct interval x);

/* The slopes f1 and f2 alone, and t on the way to them. */
void incise_patch_slopes(struct incise_patch *patch, const struct incise_grid *grid,
			 const struct incise_block *a, const struct incise_block *b);

/* All of them. */
void incise_patch_over(struct incise_patch *patch, const struct incise_grid *grid,
		       const struct incise_block *a, const struct incise_block *b);

/* ∂²F/∂a∂b */
struct interval incise_patch_mixed(const struct incise_grid *grid,
				   const struct incise_block *a,
				   const struct incise_block *b);

/* r(i,j) - r(k,l) over a patch. */
struct interval incise_patch_rules(const struct incise_grid *grid, int i, int j, int k,
				   int l, const struct incise_block *a,
				   const struct incise_block *b);

#endif
