/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The operations of the integers for a .proto.c of lib/tissue; double.h has the same ones. Each holds its
 * result to 31 bits instead of wrapping, and rounds to the nearest. 64-bit integers only, and few
 * divisions: builds in a kernel, for 32 bits too.
 *
 *   n_  numbers, Q16.16     d_  parts of directions, Q2.30     v_  three numbers     w_  64 bits
 */
#ifndef INCISE_NUMBER_FIXED_H
#define INCISE_NUMBER_FIXED_H

#include "../fixed/vector.h"
#include "fixed_kind.h"
#include "both.h"

/* Constants: p / q, to the nearest. Real numbers have no place here. */
#define N(p) ((num)(p)*65536)
#define N_OF(p, q) ((num)(((int64_t)(p)*65536 + (q) / 2) / (q)))
#define D_OF(p, q) ((dir)(((int64_t)(p)*INCISE_FIXED_UNIT + (q) / 2) / (q)))
#define D_ONE INCISE_FIXED_UNIT
#define HALF_PI N_OF(1570796327, 1000000000)
#define LEAST 1 /* the smallest number */
#define FAR_MOST INT32_MAX
#define CREEP (2 * LEAST) /* rounding of a length, mm */
#define DT_MOST INT32_MAX /* of a ramp, ns */

/* --- numbers --- */

static inline num n_add(num a, num b)
{
	return incise_fx_hold32((int64_t)a + b);
}

static inline num n_sub(num a, num b)
{
	return incise_fx_hold32((int64_t)a - b);
}

static inline num n_abs(num a)
{
	return a < 0 ? -a : a;
}

static inline num n_times(num a, num b)
{
	return incise_fx_times(a, b);
}

/* b > 0 */
static inline num n_over(num a, num b)
{
	return incise_fx_hold32(incise_fx_quotient(a, b));
}

/* a + (b - a) × part / whole; 0 ≤ part ≤ whole, whole > 0. A share of 16 bits. */
static inline num n_between(num a, num b, num part, num whole)
{
	int64_t share = div64_s64((int64_t)part * 65536, whole);

	return incise_fx_hold32(a + incise_fx_rounded(((int64_t)b - a) * share, 16));
}

/* Number of the cell in which a place lies; below 0 any that is. */
static inline int64_t n_cell(num at, num size)
{
	return (int64_t)(at / size) - (at < 0);
}

/* times × size */
static inline num n_multiple(int64_t times, num size)
{
	return incise_fx_hold32(times * size);
}

static inline num n_keep(num a)
{
	return a;
}

/* a - damping × speed. 2^31 · 2^29.3 in Q44 */
static inline num n_damp(num a, num28 damping, num speed)
{
	return incise_fx_hold32(a - incise_fx_rounded((int64_t)damping * speed, 28));
}

/* The share of a direction's part, 0 … 1. */
static inline num n_share_of(dir a)
{
	return (num)incise_fx_within(incise_fx_rounded(a < 0 ? -(int64_t)a : a, 14), 0,
				     N(1));
}

/* --- directions --- */

static inline void d_copy(dir to[3], const dir a[3])
{
	incise_fx_copy(to, a);
}

/* A pose's numbers are any. */
static inline dir d_abs(dir a)
{
	return a < -INT32_MAX ? INT32_MAX : a < 0 ? -a : a;
}

static inline dir d_dot(const dir u[3], const dir v[3])
{
	return incise_fx_dot(u, v);
}

static inline void d_cross(dir to[3], const dir u[3], const dir v[3])
{
	incise_fx_cross(to, u, v);
}

static inline void d_turn(dir to[3], const dir q[4], const dir u[3])
{
	incise_fx_rotate(to, q, u);
}

/* Make a vector of length 1. Returns false, and leaves @to, unless @a is longer than @least. */
static inline bool d_unit(dir to[3], const dir a[3], dir least)
{
	const int64_t from[3] = {a[0], a[1], a[2]};

	return incise_fx_unit(to, from, 3, least);
}

/* The same of a quaternion. Returns false if it is 0. */
static inline bool d_unit4(dir to[4], const wide q[4])
{
	return incise_fx_unit(to, q, 4, 0);
}

/* The length of a sum of directions, exact; a sum as short as this is only rounding. */
static inline bool d_mean(dir to[3], const wide sum[3])
{
	return incise_fx_unit(to, sum, 3, 64);
}

/* A pose's quaternion, within a tenth of length 1; else false, and @to stays. */
static inline bool d_attitude(dir to[4], const dir q[4])
{
	return incise_fixed_attitude(to, q);
}

/* --- vectors --- */

static inline void v_copy(num to[3], const num a[3])
{
	incise_fx_copy(to, a);
}

static inline void v_sub(num to[3], const num a[3], const num b[3])
{
	incise_fx_sub(to, a, b);
}

/* a + size × unit */
static inline void v_add(num to[3], const num a[3], num size, const dir unit[3])
{
	incise_fx_add(to, a, size, unit);
}

/* a - stiffness × b */
static inline void v_pull(num to[3], const num a[3], num stiffness, const num b[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = n_sub(a[i], n_times(stiffness, b[i]));
}

static inline num v_along(const num a[3], const dir unit[3])
{
	return incise_fx_along(a, unit);
}

/* a less its part along a direction */
static inline void v_across(num to[3], const num a[3], const dir unit[3])
{
	v_add(to, a, n_neg(v_along(a, unit)), unit);
}

static inline num v_length(const num a[3])
{
	return incise_fx_hold32(incise_fx_length(a));
}

static inline bool v_is_short(const num a[3], num most)
{
	return incise_fx_is_short(a, most);
}

static inline bool v_is_zero(const num a[3])
{
	return !a[0] && !a[1] && !a[2];
}

static inline bool v_is_number(const num a[3])
{
	(void)a;
	return true;
}

/* from + an arm turned by a quaternion */
static inline void v_reach(num to[3], const num from[3], const dir q[4], const num arm[3])
{
	num turned[3];

	incise_fx_rotate(turned, q, arm);
	for (int i = 0; i < 3; i++)
		to[i] = n_add(from[i], turned[i]);
}

static inline bool v_direction(dir to[3], const num a[3])
{
	const int64_t from[3] = {a[0], a[1], a[2]};

	return incise_fx_unit(to, from, 3, 0);
}

/* Shorten to @most, never above it. Each part is below 2^32; 2^32 · 2^28. */
bool incise_fixed_shorten(wide v[3], num most) INCISE_REALTIME;

static inline bool v_shorten(wide v[3], num most)
{
	return incise_fixed_shorten(v, most);
}

/* --- shares of a ramp, Q30; time --- */

#define W_ONE ((wide)1 << 30)

/* dt ≤ 2^31 ns */
static inline wide w_ramp(int64_t dt_ns, int64_t whole_ns)
{
	return whole_ns ? div64_s64(dt_ns << 30, whole_ns) : W_ONE;
}

static inline num w_scale(wide share, num a)
{
	return (num)incise_fx_rounded(share * a, 30);
}

/* --- work of the front: twice the work, Q32, held to ±2^62 --- */

/* work2 + (a + b) × way: 2^32 · 2^30 */
static inline wide w_work(wide work2, num a, num b, num way)
{
	int64_t most = (int64_t)1 << 62, sum = (int64_t)a + b;

	work2 += sum * incise_fx_hold(way, 1 << 30);
	return incise_fx_hold(work2, most);
}

/* √(K (work2 - most2 / 16)): 2^31 · 2^31 */
static inline num w_paid(num stiffness, wide work2, wide most2)
{
	int64_t left2 = (work2 >> 16) - (most2 >> 20);

	if (left2 <= 0)
		return 0;
	left2 = left2 > INT32_MAX ? INT32_MAX : left2;
	return incise_fx_hold32(incise_fx_root((uint64_t)stiffness * (uint64_t)left2));
}

/* work2 - (a + b) · way, which no rounding adds up in: 2^32 · 2^30 */
static inline wide w_taken(wide work2, const num a[3], const num b[3], const num way[3])
{
	for (int i = 0; i < 3; i++)
		work2 = incise_fx_hold(work2 - ((int64_t)a[i] + b[i]) *
						       incise_fx_hold(way[i], 1 << 30),
				       (int64_t)1 << 62);
	return work2;
}

/* √(K work2): 2^31 · 2^32 in Q48, or 2^31 · 2^47 in Q32 */
static inline num w_stored(num stiffness, wide work2)
{
	if (work2 <= 0)
		return 0;
	if (work2 >> 32)
		return w_paid(stiffness, work2, 0);
	return (num)(incise_fx_root((uint64_t)stiffness * (uint64_t)work2) >> 8);
}

/* --- the filter: x Q32 mm, v Q20 mm/s, a Q16 mm/s², a miss Q24 mm; dt Q30 s; shares Q26 --- */

#define W_MM ((wide)1 << 32)
#define W_MM_S ((wide)1 << 20)
#define W_MM_S2 ((wide)1 << 16)
#define W_MISS_MM ((wide)1 << 24)
#define W_SHARE ((wide)1 << 26)

static inline wide w_within(wide v, wide least, wide most)
{
	return incise_fx_within(v, least, most);
}

/* a × b / 2^shift */
static inline wide w_times(wide a, wide b, int shift)
{
	return incise_fx_rounded(a * b, shift);
}

/* The number at another scale. */
static inline wide w_shifted(wide a, int shift)
{
	return incise_fx_rounded(a, shift);
}

/* ns to s in Q30, to 2^28: 2^30 / 10^9 is 1.073741824, in Q32 below. */
static inline wide w_seconds(int64_t ns)
{
	return (ns * 4611686018) >> 32;
}

/* (period - gone) / period, ≥ 0 */
static inline wide w_left(int64_t gone_ns, span period_ns)
{
	if (gone_ns >= period_ns)
		return 0;
	return (wide)div_u64((uint64_t)(period_ns - gone_ns) << 26, (uint32_t)period_ns);
}

static inline wide w_place(num a)
{
	return a * (W_MM >> 16);
}

static inline num n_place(wide x)
{
	return incise_fx_hold32(incise_fx_rounded(x, 16));
}

static inline num n_speed(wide v)
{
	return (num)incise_fx_rounded(v, 4);
}

/* Whether a miss is no longer than @most. */
static inline bool w_is_near(const wide miss[3], wide most)
{
	int64_t length2 = 0;

	for (int i = 0; i < 3; i++) {
		if (miss[i] > most || miss[i] < -most)
			return false;
		length2 += miss[i] * miss[i];
	}
	return length2 <= most * most;
}

#endif
