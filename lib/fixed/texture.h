/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The texture of a cut, as a tick reads it: F = F_model · (1 + τ(s)) · factor(cut) where the blade
 * cuts, with s the way of the front through new tissue. Both are tables, made once by lib/model/texture.c
 * from a learned texture and a seed, so that double, integers and the kernel have the same τ of the same way.
 *
 *   τ of s   knot[(start[cut] + s / step) mod N], linear between knots, wraps around
 *
 * In a .plan file the numbers are little-endian.
 */
#ifndef INCISE_FIXED_TEXTURE_H
#define INCISE_FIXED_TEXTURE_H

#include "integers.h"

#define INCISE_TEXTURE_KNOTS 8192 /* a power of 2 */
#define INCISE_TEXTURE_CUTS 64	  /* then factors and starts come again */
#define INCISE_TEXTURE_ONE 16384  /* of knots: Q14 */
/* A knot is within ± this; the largest |τ| that a texture may have: 0.9. */
#define INCISE_TEXTURE_MOST (9 * INCISE_TEXTURE_ONE / 10)
#define INCISE_TEXTURE_FACTOR_MOST (16 << 16)

struct incise_fixed_texture {
	int32_t step_shift;  /* a knot each 2^step_shift / 65536 mm; 8 … 20 */
	int32_t most;	     /* largest |knot| */
	int32_t factor_most; /* largest factor, Q16.16 */
	int32_t reserved;    /* 0 */
	int32_t factor
		[INCISE_TEXTURE_CUTS]; /* of the cuts in turn, Q16.16, above 0; mean about 1 */
	uint16_t start[INCISE_TEXTURE_CUTS]; /* where a cut begins, in knots */
	int16_t knot[INCISE_TEXTURE_KNOTS];  /* τ, Q14 */
};

/* Tell whether all of it is within its ranges. */
bool incise_fixed_texture_good(const struct incise_fixed_texture *texture);

#endif
