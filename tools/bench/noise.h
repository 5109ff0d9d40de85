/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Random numbers of a bench: the same in each run, and not the virtual rig's.
 */
#ifndef INCISE_NOISE_H
#define INCISE_NOISE_H

#include <stdint.h>
#include "../../lib/base/random.h"

/* 0 … 1, without 1, by Knuth's linear congruential generator. */
static inline double lcg_uniform(uint64_t *state)
{
	incise_random_step(state);
	return (double)(*state >> 11) * 0x1p-53;
}

#endif
