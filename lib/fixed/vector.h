/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Vectors in integers: lengths Q16.16 mm, unit vectors and quaternions (w first) Q2.30.
 * base/vector.h has the same in double.
 *
 * A unit vector here is one whose squares add up to 1 within INCISE_FX_UNIT_SLACK, so that no
 * component is beyond 2^30 + 2^6; the bounds of all products rest on that.
 */
#ifndef INCISE_FX_VECTOR_H
#define INCISE_FX_VECTOR_H

#include "arithmetic.h"

#define INCISE_FIXED_UNIT (1 << 30) /* 1.0 as part of a direction */

/* Error of the sum of squares of a unit vector, Q60: each component is off by 2^4 at most. */
#define INCISE_FX_UNIT_SLACK ((int64_t)1 << 36)

/* A difference of places beyond this counts as this: 16384 mm. */
#define INCISE_FX_AWAY_MAX (1 << 30)

static inline void incise_fx_copy(int32_t to[3], const int32_t a[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i];
}

/* a - b, each component held to INCISE_FX_AWAY_MAX. */
static inline void incise_fx_sub(int32_t to[3], const int32_t a[3], const int32_t b[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = (int32_t)incise_fx_hold((int64_t)a[i] - b[i], INCISE_FX_AWAY_MAX);
}

/* a + length × unit, held to 31 bits. 2^31 · 2^31 = 2^62. */
static inline void incise_fx_add(int32_t to[3], const int32_t a[3], int32_t length,
				 const int32_t unit[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = incise_fx_hold32(
			a[i] + incise_fx_rounded((int64_t)length * unit[i], 30));
}

/* a·u of a difference of places, Q16.16: 3 · 2^30 · 2^31 < 2^63, in Q46. */
static inline int32_t incise_fx_along(const int32_t a[3], const int32_t unit[3])
{
	int64_t sum = 0;

	for (int i = 0; i < 3; i++)
		sum += (int64_t)a[i] * unit[i];
	return incise_fx_hold32(incise_fx_rounded(sum, 30));
}

/* u·v of unit vectors, Q2.30: 3 · 2^60.1 < 2^62, in Q60. */
static inline int32_t incise_fx_dot(const int32_t u[3], const int32_t v[3])
{
	int64_t sum = 0;

	for (int i = 0; i < 3; i++)
		sum += (int64_t)u[i] * v[i];
	return (int32_t)incise_fx_rounded(sum, 30);
}

/* u × v of unit vectors, Q2.30: 2 · 2^60.1 in Q60. Its length is below 1, not 1. */
void incise_fx_cross(int32_t to[3], const int32_t u[3],
		     const int32_t v[3]) INCISE_REALTIME;

/* |a|, to the nearest; a in any format, each component below 2^31. */
uint32_t incise_fx_length(const int32_t a[3]) INCISE_REALTIME;

/* Whether the length is no more than @most, ≥ 0, without a root. */
bool incise_fx_is_short(const int32_t a[3], int32_t most) INCISE_REALTIME;

/*
 * Make the n (3 or 4) components of @a a unit vector. @a in any format, each below 2^62.
 *
 * Returns false, and leaves @to as it is, where |a| is not above @least.
 */
bool incise_fx_unit(int32_t *to, const int64_t *a, int n, int64_t least) INCISE_REALTIME;

/* Whether the n components of Q2.30 are a unit vector. */
bool incise_fx_is_unit(const int32_t *a, int n) INCISE_REALTIME;

/* A unit vector turned by a unit quaternion. */
void incise_fx_rotate(int32_t to[3], const int32_t q[4],
		      const int32_t unit[3]) INCISE_REALTIME;

/*
 * Make a pose's quaternion a unit one. Returns false, and leaves @to, where it is more than a tenth
 * longer or shorter than that: devices round their numbers, but not by so much.
 */
bool incise_fixed_attitude(int32_t to[4], const int32_t quaternion[4]) INCISE_REALTIME;

#endif
