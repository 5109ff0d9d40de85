/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A property tries a twentieth of its cases, or all with CASES=all in the environment, as in
 * `make check-full`. SEED=N draws other ones; the seed is printed.
 */
#ifndef TEST_CASES_H
#define TEST_CASES_H

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static inline bool cases_are_all(void)
{
	const char *cases = getenv("CASES");

	return cases && strcmp(cases, "all") == 0;
}

/* @return of @all cases a twentieth, at least @least */
static inline int cases_of(int all, int least)
{
	int few = all / 20 > least ? all / 20 : least;

	return cases_are_all() || few > all ? all : few;
}

/* @return SEED, or @seed */
static inline uint64_t cases_seed(uint64_t seed)
{
	const char *text = getenv("SEED");

	if (text)
		seed = strtoull(text, NULL, 0);
	printf("seed %" PRIu64 "\n", seed);
	return seed;
}

/* @return log of the binomial probability of @k of @n with a share of @p */
static inline double cases_log_chance(int k, int n, double p)
{
	return lgamma(n + 1.0) - lgamma(k + 1.0) - lgamma(n - k + 1.0) + k * log(p) +
	       (n - k) * log1p(-p);
}

/* @return whether @held of @n cases are within the binomial 99.9 % range about a share of @p */
static inline bool cases_hold(int held, int n, double p)
{
	double below = 0, above = 0;

	for (int k = 0; k <= held; k++)
		below += exp(cases_log_chance(k, n, p));
	for (int k = held; k <= n; k++)
		above += exp(cases_log_chance(k, n, p));
	return below > 0.0005 && above > 0.0005;
}

#endif
