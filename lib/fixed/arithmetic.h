/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Arithmetic that the integer parts share: numbers that are held instead of wrapped, products and
 * quotients to the nearest, the square root. 64-bit integers only.
 */
#ifndef INCISE_FX_ARITHMETIC_H
#define INCISE_FX_ARITHMETIC_H

#include <incise/export.h>
#include "integers.h"

/* The nearest of least … most. */
static inline int64_t incise_fx_within(int64_t v, int64_t least, int64_t most)
{
	return v > most ? most : v < least ? least : v;
}

/* The nearest of ±most. As much below 0 as above, so that both sides are the same. */
static inline int64_t incise_fx_hold(int64_t v, int64_t most)
{
	return incise_fx_within(v, -most, most);
}

/* The nearest number of 32 bits, but for INT32_MIN. */
static inline int32_t incise_fx_hold32(int64_t v)
{
	return (int32_t)incise_fx_hold(v, INT32_MAX);
}

/*
 * v / 2^shift to the nearest, halves away from 0. A right shift alone would floor.
 * |v| ≤ 2^63 - 2^shift, shift 1 … 62.
 */
static inline int64_t incise_fx_rounded(int64_t v, int shift)
{
	int64_t half = (int64_t)1 << (shift - 1);

	return v < 0 ? -((-v + half) >> shift) : (v + half) >> shift;
}

/* a × b in Q16.16 to the nearest; b is held to 31 bits: 2^31 · 2^31 = 2^62. */
static inline int32_t incise_fx_times(int32_t a, int64_t b)
{
	return incise_fx_hold32(incise_fx_rounded((int64_t)a * incise_fx_hold32(b), 16));
}

/* a / b in Q16.16 to the nearest; b ≥ 1. 2^31 << 16 = 2^47. */
static inline int64_t incise_fx_quotient(int32_t a, int32_t b)
{
	int64_t size = (int64_t)(a < 0 ? -(int64_t)a : a) << 16;

	size = div64_s64(size + b / 2, b);
	return a < 0 ? -size : size;
}

/* √v, rounded down. Real-time safe: two divisions. */
uint32_t incise_fx_root(uint64_t v) INCISE_REALTIME;

#endif
