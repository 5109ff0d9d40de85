/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Draws of a test from its seed. */
#ifndef INCISE_TEST_DRAWS_H
#define INCISE_TEST_DRAWS_H

#include <math.h>
#include <stdint.h>
#include "../../../lib/base/random.h"

static uint64_t seed;

/* Of 0 to 1, neither of them. */
static inline double uniform(void)
{
	incise_random_step(&seed);
	return ((seed >> 11) + 0.5) * 0x1p-53;
}

static inline double normal(void)
{
	return sqrt(-2 * log(uniform())) * cos(2 * M_PI * uniform());
}

#endif
