/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A model as fixed point sees it: a full grid of Gaussians over inputs a and b,
 *
 *   y = Σi ā(i)(xa) Σj b̄(j)(xb)·r(i,j)(xa, xb),   r = p[0] + p[1]·xa + p[2]·xb
 *
 * A model of one input has its input as b, and a trivial a with one function.
 */
#ifndef INCISE_GRID_H
#define INCISE_GRID_H

#include <stdbool.h>
#include "axis.h"

struct incise_grid {
	bool one; /* input */
	struct incise_axis a, b;
	double p[INCISE_FIXED_MFS_MAX][INCISE_FIXED_MFS_MAX][3];
};

/* Refuses by name what is no such model: -ENOTSUP, -E2BIG, -ERANGE. */
int incise_grid_init(struct incise_grid *grid, const struct incise_model *model,
		     struct incise_error *err);

/* What a table's or an evaluation's error depends on. */
struct incise_cells {
	double from;  /* lower end of the support */
	double width; /* of a cell */
	int n;
};

/*
 * Certified bounds of the error that comes of linear interpolation between knots and of
 * the inputs' rounding, over the whole support. Rounding of the arithmetic is not in it.
 */
double incise_bound_table(const struct incise_grid *grid, const struct incise_cells *a,
			  const struct incise_cells *b);
double incise_bound_force(const struct incise_grid *grid, const struct incise_cells *a,
			  const struct incise_cells *b);

/* The same for the direct arithmetic: error of the degrees, and the inputs' rounding. */
double incise_bound_direct(const struct incise_grid *grid);

/* Largest magnitude of any rule's output over the support, of its parts before they
 * cancel, and of a rule's slope by input a. */
struct incise_grid_size {
	double rule, parts, slope;
};
void incise_grid_size(const struct incise_grid *grid, struct incise_grid_size *size);

#endif
