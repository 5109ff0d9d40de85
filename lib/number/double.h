/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The operations of doubles for a .proto.c of lib/tissue; see fixed.h.
 */
#ifndef INCISE_NUMBER_DOUBLE_H
#define INCISE_NUMBER_DOUBLE_H

#include <float.h>
#include "../base/vector.h"
#include <incise/clock.h>
#include <stdint.h>
#include "double_kind.h"
#include "both.h"

#define N(p) ((num)(p))
#define N_OF(p, q) ((num)(p) / (q))
#define D_OF(p, q) ((dir)(p) / (q))
#define D_ONE 1.0
#define HALF_PI (M_PI / 2)
#define LEAST 0.0
#define FAR_MOST INFINITY
#define CREEP 1e-12 /* rounding of a length, mm */
#define DT_MOST INT64_MAX

/* --- numbers --- */

static inline num n_add(num a, num b)
{
	return a + b;
}

static inline num n_sub(num a, num b)
{
	return a - b;
}

static inline num n_abs(num a)
{
	return fabs(a);
}

static inline num n_times(num a, num b)
{
	return a * b;
}

static inline num n_over(num a, num b)
{
	return a / b;
}

static inline num n_between(num a, num b, num part, num whole)
{
	return a + part / whole * (b - a);
}

static inline int64_t n_cell(num at, num size)
{
	double cell = floor(at / size);

	/* NaN is in no range. */
	return cell >= 0 ? (int64_t)fmin(cell, 1e9) : -1;
}

static inline num n_multiple(int64_t times, num size)
{
	return (num)times * size;
}

static inline float n_keep(num a)
{
	return (float)a;
}

static inline num n_damp(num a, num28 damping, num speed)
{
	return a - damping * speed;
}

static inline num n_share_of(dir a)
{
	return n_min(fabs(a), 1);
}

/* --- directions --- */

static inline void d_copy(dir to[3], const dir a[3])
{
	v3_copy(to, a);
}

static inline dir d_abs(dir a)
{
	return fabs(a);
}

static inline dir d_dot(const dir u[3], const dir v[3])
{
	return v3_dot(u, v);
}

static inline void d_cross(dir to[3], const dir u[3], const dir v[3])
{
	v3_cross(to, u, v);
}

static inline void d_turn(dir to[3], const dir q[4], const dir u[3])
{
	v3_rotate(to, q, u);
}

static inline bool d_unit(dir to[3], const dir a[3], dir least)
{
	return v3_unit(to, a, least);
}

static inline double dot4(const double a[4], const double b[4])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

static inline bool d_unit4(dir to[4], const wide q[4])
{
	double length = sqrt(dot4(q, q));

	if (!(length > 0))
		return false;
	for (int i = 0; i < 4; i++)
		to[i] = q[i] / length;
	return true;
}

/* 3 · 64 additions below 64, each off by 7e-15. */
static inline bool d_mean(dir to[3], const wide sum[3])
{
	return v3_unit(to, sum, 1e-9);
}

static inline bool d_attitude(dir to[4], const dir q[4])
{
	double length = sqrt(dot4(q, q));

	return length > 0.9 && length < 1.1 && d_unit4(to, q);
}

/* --- vectors --- */

static inline void v_copy(num to[3], const num a[3])
{
	v3_copy(to, a);
}

static inline void v_sub(num to[3], const num a[3], const num b[3])
{
	v3_sub(to, a, b);
}

static inline void v_add(num to[3], const num a[3], num size, const dir unit[3])
{
	v3_add(to, a, size, unit);
}

static inline void v_pull(num to[3], const num a[3], num stiffness, const num b[3])
{
	v3_add(to, a, -stiffness, b);
}

static inline num v_along(const num a[3], const dir unit[3])
{
	return v3_dot(a, unit);
}

/* a less its part along a direction */
static inline void v_across(num to[3], const num a[3], const dir unit[3])
{
	v_add(to, a, n_neg(v_along(a, unit)), unit);
}

static inline num v_length(const num a[3])
{
	return v3_length(a);
}

static inline bool v_is_short(const num a[3], num most)
{
	return v3_length(a) <= most;
}

static inline bool v_is_zero(const num a[3])
{
	return v3_length(a) == 0;
}

static inline bool v_is_number(const num a[3])
{
	return v3_finite(a);
}

static inline void v_reach(num to[3], const num from[3], const dir q[4], const num arm[3])
{
	num turned[3];

	v3_rotate(turned, q, arm);
	v3_add(to, from, 1, turned);
}

static inline bool v_direction(dir to[3], const num a[3])
{
	return v3_unit(to, a, 0);
}

/*
 * Scaling rounds each component, and the length of it rounds again: 4 roundings of half an ulp.
 * Aiming lower by twice as much keeps what is computed below the limit. The squares of huge
 * components would overflow.
 */
static inline bool v_shorten(wide v[3], num most)
{
	double largest = fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2])), unit[3], length;

	if (largest <= most && v3_length(v) <= most)
		return false;
	for (int i = 0; i < 3; i++)
		unit[i] = v[i] / largest;
	length = v3_length(unit);
	for (int i = 0; i < 3; i++)
		v[i] = unit[i] * (most / length * (1 - 4 * DBL_EPSILON));
	return true;
}

/* --- shares of a ramp; time --- */

#define W_ONE 1.0

static inline wide w_ramp(int64_t dt_ns, double whole_ns)
{
	return whole_ns > 0 ? (double)dt_ns / whole_ns : W_ONE;
}

static inline num w_scale(wide share, num a)
{
	return share * a;
}

/* --- work of the front: twice the work, N mm --- */

static inline wide w_work(wide work2, num a, num b, num way)
{
	return work2 + (a + b) * way;
}

static inline num w_paid(num stiffness, wide work2, wide most2)
{
	return sqrt(stiffness * n_max(work2 - most2 / 16, 0));
}

static inline wide w_taken(wide work2, const num a[3], const num b[3], const num way[3])
{
	return work2 - v3_dot(a, way) - v3_dot(b, way);
}

static inline num w_stored(num stiffness, wide work2)
{
	return sqrt(stiffness * n_max(work2, 0));
}

/* --- the filter: mm, mm/s, mm/s², s --- */

#define W_MM 1.0
#define W_MM_S 1.0
#define W_MM_S2 1.0
#define W_MISS_MM 1.0
#define W_SHARE 1.0

static inline wide w_within(wide v, wide least, wide most)
{
	return n_within(v, least, most);
}

static inline wide w_times(wide a, wide b, int shift)
{
	(void)shift;
	return a * b;
}

static inline wide w_shifted(wide a, int shift)
{
	(void)shift;
	return a;
}

static inline wide w_seconds(int64_t ns)
{
	return (double)ns / INCISE_NS_PER_S;
}

static inline wide w_left(int64_t gone_ns, span period_ns)
{
	return n_max(1 - (double)gone_ns / period_ns, 0);
}

static inline wide w_place(num a)
{
	return a;
}

static inline num n_place(wide x)
{
	return x;
}

static inline num n_speed(wide v)
{
	return v;
}

static inline bool w_is_near(const wide miss[3], wide most)
{
	return v3_length(miss) <= most;
}

#endif
