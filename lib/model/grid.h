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

/*
 * What a model's fixed-point error depends on, patch by patch over the whole support and
 * one cell beyond, enclosed by interval arithmetic. Made once, asked for many tables.
 */
struct incise_survey;

/* Fewest cells per input that a table may have: how far one cell may reach. */
#define INCISE_SURVEY_CELLS 32

/* NULL without memory. */
struct incise_survey *incise_survey_new(const struct incise_grid *grid);
void incise_survey_free(struct incise_survey *survey);

/*
 * Certified bounds of the error that comes of linear interpolation over cells of width wa
 * and wb, or of the direct arithmetic's degrees, and of the inputs' rounding. Rounding on
 * the rest of the way is not in it. HUGE_VAL where nothing can be certified.
 */
double incise_survey_table(const struct incise_survey *survey, double wa, double wb);
double incise_survey_force(const struct incise_survey *survey, double wa, double wb);
double incise_survey_direct(const struct incise_survey *survey);

/* Largest magnitude of any rule's output over the support, of its parts before they
 * cancel, and of a rule's slope by input a. */
struct incise_grid_size {
	double rule, parts, slope;
};
void incise_grid_size(const struct incise_grid *grid, struct incise_grid_size *size);

#endif
