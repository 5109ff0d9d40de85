/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What repeats are worth: a median, and the standard uncertainty of a mean where noise may
 * go on from one repeat to the next.
 */
#ifndef INCISE_REPEATS_H
#define INCISE_REPEATS_H

/* Of n >= 1 values, which are sorted. */
double repeats_median(double *values, int n);

/*
 * Standard deviation of noise from n absolute residuals, which are sorted, outliers or not
 * (at most a quarter of few). Of few it comes out larger, so that a good one is not lost for
 * a chance: twice as large for 12.
 */
double repeats_sd(double *absolute, int n);

/*
 * Standard uncertainty of the mean of n values whose residuals these are, in the order they
 * came; @fitted numbers have been taken from them. As with Student's t, few have a wider
 * one, so that twice it holds 95.45 %. 0 for one value: of its scatter nothing is known.
 * *effective: how many independent ones they are worth.
 */
double repeats_u(const double *residual, int n, int fitted, int *effective);

#endif
