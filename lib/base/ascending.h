/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The order of doubles, and their median.
 */
#ifndef INCISE_ASCENDING_H
#define INCISE_ASCENDING_H

#include <stdlib.h>

/* For qsort(3). */
static inline int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* The median of n ≥ 1 values, which are sorted. */
static inline double median(double *values, int n)
{
	qsort(values, (size_t)n, sizeof(*values), ascending);
	return (values[n / 2] + values[(n - 1) / 2]) / 2;
}

#endif
