/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A straight line y = zero + slope x that nearly half of the points (a quarter of fewer than
 * 20) cannot bend: least median of squares (P. J. Rousseeuw, J. Am. Stat. Assoc. 79, 1984),
 * then least squares of the points near it.
 */
#ifndef INCISE_ROBUST_LINE_H
#define INCISE_ROBUST_LINE_H

#include <stdbool.h>

struct robust_line {
	double slope, zero;
	double sd; /* of the points near it */
};

/*
 * Fit. @sd_min: points within four of it are no outliers. @outlier: set for those of the n
 * points that are far off. Returns 0; -EDOM (all x alike), -ENOMEM.
 */
int incise_robust_line(const double *x, const double *y, int n, double sd_min,
		       struct robust_line *line, bool *outlier);

#endif
