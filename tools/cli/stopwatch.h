/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Times of runs, and what they come to: medians and percentiles, as a mean says little of
 * a machine that is shared.
 */
#ifndef INCISE_STOPWATCH_H
#define INCISE_STOPWATCH_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

/* CLOCK_MONOTONIC, ns; and any clock of clock_gettime(2). */
double stopwatch_ns(void);
double stopwatch_of(clockid_t clock);

/* The time that reading it twice adds, ns: measured now. */
double stopwatch_own_ns(void);

void stopwatch_sort(double *times, int n);

/* Whether n values resolve a percentile: one of them at least lies beyond it, so that the 99.9th
 * takes 1000. The median takes one. */
bool stopwatch_resolves(uint64_t n, double q);

/* Quantile of sorted times: nearest rank; q from 0 to 1. NaN if they are too few, see above. */
double stopwatch_quantile(const double *sorted, int n, double q);

/* Mean of the middle half of sorted times, which is finer than the clock's steps. */
double stopwatch_middle(const double *sorted, int n);

#endif
