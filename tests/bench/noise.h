/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Random numbers of benches: the same in each run, and not the virtual rig's. */
#ifndef INCISE_TESTS_BENCH_NOISE_H
#define INCISE_TESTS_BENCH_NOISE_H

#include <math.h>
#include "../../lib/base/random.h"

/* 0 … 1, without 1. */
static inline double noise_uniform(uint64_t *state)
{
	return (double)(incise_random_next(state) >> 11) * 0x1p-53;
}

/* Of mean 0 and sd 1; of Box and Muller's two one. */
static inline double noise_normal(uint64_t *state)
{
	double size = sqrt(-2 * log(1 - noise_uniform(state)));

	return size * cos(2 * M_PI * noise_uniform(state));
}

/* Of mean 1. */
static inline double noise_exponential(uint64_t *state)
{
	return -log(1 - noise_uniform(state));
}

#endif
