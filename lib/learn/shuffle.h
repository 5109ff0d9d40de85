/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Chance that depends on the seed only, the same on every machine (SplitMix64): random
 * numbers, and a random order (Fisher–Yates).
 */
#ifndef INCISE_SHUFFLE_H
#define INCISE_SHUFFLE_H

#include <stddef.h>
#include <stdint.h>

/* Next number, uniform in [-1, 1). */
double incise_random(uint64_t *state);

/* Fill order with 0 … n-1 in random order. */
void incise_shuffle(size_t *order, size_t n, uint64_t seed);

#endif
