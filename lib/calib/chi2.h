/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A quantile of the chi² distribution.
 */
#ifndef INCISE_CHI2_H
#define INCISE_CHI2_H

#include <math.h>

/* The number that chi² exceeds in 1 of 100, by Wilson and Hilferty. */
static inline double chi2_99(int freedom)
{
	double h = 2.0 / (9 * freedom);

	return freedom * pow(1 - h + 2.326348 * sqrt(h), 3);
}

#endif
