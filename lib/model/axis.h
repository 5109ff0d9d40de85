/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One input of a grid of Gaussians: its normalised degrees ā(i) = A(i)/ΣA and their
 * derivatives, at a point and enclosed over an interval. What fixed-point tables hold,
 * and what their error depends on.
 */
#ifndef INCISE_AXIS_H
#define INCISE_AXIS_H

#include <incise/fixed.h>
#include <incise/model.h>
#include "interval.h"

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

#endif
