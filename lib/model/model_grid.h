/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A model as fixed point sees it: a full grid of Gaussians over inputs a and b,
 *
 *   y = Σi ā(i)(xa) Σj b̄(j)(xb)·r(i,j)(xa, xb),   r = p[0] + p[1]·xa + p[2]·xb
 *
 * with ā(i) = A(i)/ΣA. A model of one input has its input as b, and a trivial a with one
 * function. Interval arithmetic encloses its derivatives over a patch of the support, so that
 * nothing within the patch escapes:
 *
 *   xb ▲
 *      │   ┌──────┐
 *      │   │patch │ b     f1 = ∂F/∂a, f2 = ∂F/∂b, f11 = ∂²F/∂a², f22 = ∂²F/∂b²
 *      │   └──────┘
 *      └──────a──────▶ xa
 */
#ifndef INCISE_MODEL_GRID_H
#define INCISE_MODEL_GRID_H

#include <stdbool.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "interval.h"

/* One input: its functions and its support. */
struct incise_axis {
	int n;
	double min, max; /* support, as given and as rounded to Q16.16 */
	double s[INCISE_FIXED_MFS_MAX], c[INCISE_FIXED_MFS_MAX];
};

/* Enclosures of the degrees, and of their first and second derivatives. */
struct incise_axis_range {
	struct interval a[INCISE_FIXED_MFS_MAX];
	struct interval d1[INCISE_FIXED_MFS_MAX];
	struct interval d2[INCISE_FIXED_MFS_MAX];
};

void incise_axis_init(struct incise_axis *axis, const struct incise_model *model,
		      int input);

/* The degrees at a point, in long double: for table entries. */
void incise_axis_at(const struct incise_axis *axis, long double x, long double *a);

void incise_axis_over(const struct incise_axis *axis, struct interval x,
		      struct incise_axis_range *range);

/* Inputs that a grid has; more only have the direct arithmetic, see incise_many_check(). */
#define INCISE_GRID_INPUTS_MAX 2

struct incise_grid {
	bool one; /* input */
	struct incise_axis a, b;
	double p[INCISE_FIXED_MFS_MAX][INCISE_FIXED_MFS_MAX][3];
};

/* 0; -ENOTSUP, -E2BIG, -ERANGE with the part of the model that has no such form. */
int incise_grid_init(struct incise_grid *grid, const struct incise_model *model,
		     struct incise_error *err);

/* Consequents beyond this make infinities on the way, and no number format holds them. */
#define INCISE_GRID_LARGEST 1e12

/* Largest magnitude of any rule's output over the support, of its parts before they
 * cancel, and of a rule's slope by input a. */
struct incise_grid_size {
	double rule, parts, slope;
};
void incise_grid_size(const struct incise_grid *grid, struct incise_grid_size *size);

/* A part of one input's support. */
struct incise_block {
	struct interval x;
	struct incise_axis_range range;
	int main; /* function with the largest degree in the middle */
};

void incise_block_over(struct incise_block *block, const struct incise_axis *axis,
		       struct interval x);

/* Sums T, h over input b's functions, and derivatives of the model, over two blocks. */
struct incise_patch {
	struct interval t[INCISE_FIXED_MFS_MAX];  /* T(i) - T(main) */
	struct interval t2[INCISE_FIXED_MFS_MAX]; /* T(i)'' */
	struct interval h[INCISE_FIXED_MFS_MAX];  /* h(i) - h(main) */
	/* r(i,j) - r(i,main) */
	struct interval r[INCISE_FIXED_MFS_MAX][INCISE_FIXED_MFS_MAX];
	struct interval f1, f2, f11, f22;
};

/* The slopes f1 and f2 alone, and t and r on the way to them. */
void incise_patch_slopes(struct incise_patch *patch, const struct incise_grid *grid,
			 const struct incise_block *a, const struct incise_block *b);

/* All of them. */
void incise_patch_over(struct incise_patch *patch, const struct incise_grid *grid,
		       const struct incise_block *a, const struct incise_block *b);

/* ∂²F/∂a∂b over the blocks of a patch */
struct interval incise_patch_mixed(const struct incise_patch *patch,
				   const struct incise_grid *grid,
				   const struct incise_block *a,
				   const struct incise_block *b);

/*
 * Bounds of a model's fixed-point error, from patches over the whole support and one cell
 * beyond. Made once, asked for many tables.
 */
struct incise_survey;

/* Fewest cells per input that a table may have: how far one cell may reach. */
#define INCISE_SURVEY_CELLS 32

/* A survey of a grid that outlives it. NULL without memory. */
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

/*
 * --- three inputs and more, for the direct arithmetic ---
 *
 * Its bound is one over the whole support, of each input by itself: coarser than a survey, and no
 * patches over four dimensions.
 */

/* 0; -ENOTSUP, -E2BIG, -ERANGE as incise_grid_init(). For any number of inputs. */
int incise_many_check(const struct incise_model *model, struct incise_error *err);

/* For a checked model: sizes except @slope; and as incise_survey_direct(). */
void incise_many_size(const struct incise_model *model, struct incise_grid_size *size);
double incise_many_direct(const struct incise_model *model);

#endif
