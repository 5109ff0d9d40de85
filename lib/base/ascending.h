/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The order of doubles, for qsort(3).
 */
#ifndef INCISE_ASCENDING_H
#define INCISE_ASCENDING_H

static inline int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

#endif
