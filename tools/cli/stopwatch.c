// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Times of runs; see stopwatch.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../../lib/base/ascending.h"
#include "stopwatch.h"

double stopwatch_of(clockid_t clock)
{
	struct timespec t;

	clock_gettime(clock, &t);
	return t.tv_sec * 1e9 + t.tv_nsec;
}

double stopwatch_ns(void)
{
	return stopwatch_of(CLOCK_MONOTONIC);
}

void stopwatch_sort(double *times, int n)
{
	qsort(times, n, sizeof(*times), ascending);
}

double stopwatch_own_ns(void)
{
	double times[10001];
	const int n = sizeof(times) / sizeof(*times);

	for (int i = 0; i < n; i++) {
		times[i] = stopwatch_ns();
		times[i] = stopwatch_ns() - times[i];
	}
	stopwatch_sort(times, n);
	return stopwatch_middle(times, n);
}

bool stopwatch_resolves(uint64_t n, double q)
{
	/* 1e-9: (1 - 0.95) * 20 is a rounding off 1. */
	return q == 0.5 ? n >= 1 : fmin(q, 1 - q) * (double)n >= 1 - 1e-9;
}

double stopwatch_quantile(const double *sorted, int n, double q)
{
	if (!stopwatch_resolves((uint64_t)n, q))
		return NAN;
	return sorted[(int)(q * (n - 1) + 0.5)];
}

double stopwatch_middle(const double *sorted, int n)
{
	int from = n / 4, to = n - n / 4;
	double sum = 0;

	for (int i = from; i < to; i++)
		sum += sorted[i];
	return sum / (to - from);
}
