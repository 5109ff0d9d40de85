// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Random numbers of the virtual rig; see random.h.
 */
#include <math.h>
#include "random.h"

/* The output function of splitmix64 (Steele, Lea, Flood 2014): every bit of x matters. */
static uint64_t mix(uint64_t x)
{
	x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
	x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
	return x ^ (x >> 31);
}

uint64_t incise_random_bits(uint64_t key, uint64_t n)
{
	return mix(key + (n + 1) * 0x9e3779b97f4a7c15ULL);
}

uint64_t incise_random_key(uint64_t seed, enum incise_random_purpose purpose)
{
	/* Mixed twice: seeds and purposes are small numbers that lie close together. */
	return mix(incise_random_bits(mix(seed + 1), purpose));
}

double incise_random_uniform(uint64_t key, uint64_t n)
{
	return (double)(incise_random_bits(key, n) >> 11) * 0x1p-53;
}

double incise_random_normal(uint64_t key, uint64_t n)
{
	uint64_t bits = incise_random_bits(key, n);
	double radius = ((double)(bits >> 32) + 0.5) * 0x1p-32; /* never 0 */
	double angle = (double)(bits & 0xffffffff) * 0x1p-32;

	return sqrt(-2 * log(radius)) * cos(2 * M_PI * angle); /* Box and Muller */
}
