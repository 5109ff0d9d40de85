/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Random numbers by splitmix64: number n of a stream is a function of the stream's key and n
 * alone. So streams do not disturb each other, and the order of reading changes nothing. Two
 * generators with a state serve searches and splits that are to be repeatable.
 */
#ifndef INCISE_BASE_RANDOM_H
#define INCISE_BASE_RANDOM_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* Streams of the virtual rig. */
enum incise_random_purpose {
	INCISE_RANDOM_SURGEON,
	INCISE_RANDOM_TOOTH,
	INCISE_RANDOM_BOUNDARY,
	INCISE_RANDOM_TRACKER,
	INCISE_RANDOM_FORCE,
	INCISE_RANDOM_CAMERA,
	INCISE_RANDOM_STAMP,
};

/* The output function of splitmix64 (Steele, Lea, Flood 2014): every bit of x matters. */
static inline uint64_t incise_random_mix(uint64_t x)
{
	x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
	x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
	return x ^ (x >> 31);
}

/* 64 random bits. */
static inline uint64_t incise_random_bits(uint64_t key, uint64_t n)
{
	return incise_random_mix(key + (n + 1) * 0x9e3779b97f4a7c15ULL);
}

/* The key of a stream. Mixed twice: seeds and purposes are small, close numbers. */
static inline uint64_t incise_random_key(uint64_t seed,
					 enum incise_random_purpose purpose)
{
	return incise_random_mix(
		incise_random_bits(incise_random_mix(seed + 1), purpose));
}

/* Uniformly distributed in 0 … 1, 1 excluded. */
static inline double incise_random_uniform(uint64_t key, uint64_t n)
{
	return (double)(incise_random_bits(key, n) >> 11) * 0x1p-53;
}

/* Normally distributed with mean 0 and sd 1 (Box and Muller); never beyond 6.7. */
static inline double incise_random_normal(uint64_t key, uint64_t n)
{
	uint64_t bits = incise_random_bits(key, n);
	double radius = ((double)(bits >> 32) + 0.5) * 0x1p-32; /* never 0 */
	double angle = (double)(bits & 0xffffffff) * 0x1p-32;

	return sqrt(-2 * log(radius)) * cos(2 * M_PI * angle);
}

/* The next state of Knuth's MMIX generator; its high bits are the good ones. */
static inline uint64_t incise_random_step(uint64_t *state)
{
	return *state = *state * 6364136223846793005ULL + 1442695040888963407ULL;
}

/* A number of 0 … n-1 from such a state. */
static inline uint32_t incise_random_draw(uint64_t *state, uint32_t n)
{
	return (uint32_t)(incise_random_step(state) >> 33) % n;
}

/* The next 64 bits of splitmix64 with a state. */
static inline uint64_t incise_random_next(uint64_t *state)
{
	return incise_random_mix(*state += 0x9e3779b97f4a7c15ULL);
}

/* The next number, uniformly distributed in -1 … 1, 1 excluded. */
static inline double incise_random_symmetric(uint64_t *state)
{
	return (double)(incise_random_next(state) >> 11) * 0x1p-52 - 1;
}

/* Fill order with 0 … n-1 in random order (Fisher and Yates). */
static inline void incise_random_shuffle(size_t *order, size_t n, uint64_t seed)
{
	for (size_t i = 0; i < n; i++)
		order[i] = i;
	for (size_t i = n; i > 1; i--) {
		/* The modulo's bias is below n/2^64. */
		size_t j = incise_random_next(&seed) % i;
		size_t other = order[j];

		order[j] = order[i - 1];
		order[i - 1] = other;
	}
}

#endif
