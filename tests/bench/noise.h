/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Random numbers of other distributions than a bench of tools has. */
#ifndef INCISE_TESTS_BENCH_NOISE_H
#define INCISE_TESTS_BENCH_NOISE_H

#include <math.h>
#include "../../tools/bench/noise.h"

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
