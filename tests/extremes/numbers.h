/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Random numbers and attitudes up to the ends of their types, the same in every run by seed.
 */
#ifndef INCISE_EXTREMES_NUMBERS_H
#define INCISE_EXTREMES_NUMBERS_H

#include <float.h>
#include <math.h>
#include <stdint.h>

/* The state of the generator, xorshift64*: not 0. extremes_try() sets it for each property. */
extern uint64_t any_state;

static inline uint64_t any(void)
{
	any_state ^= any_state << 13;
	any_state ^= any_state >> 7;
	any_state ^= any_state << 17;
	return any_state * 0x2545f4914f6cdd1d;
}

static inline uint32_t below(uint32_t n)
{
	return (uint32_t)((any() >> 32) * n >> 32);
}

static inline double between(double low, double high)
{
	return low + (high - low) * ((double)(any() >> 11) * 0x1p-53);
}

static inline double any_bits(void)
{
	union {
		uint64_t bits;
		double value;
	} u = {.bits = any()};

	return u.value;
}

/* Ends of double, of integers and of what the library takes, and their neighbours. */
double special(void);

/* One of @odds each is special or of any bits; the rest is within a range. */
double any_number(uint32_t odds, double low, double high);

/* An integer: the ends of int32_t and small ones in half of the cases. */
int32_t any_integer(void);

/* A quaternion: often special, near where blade and handle change, or not of length 1. */
void any_attitude(double q[4]);

#endif
