/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Interval arithmetic in double, rounded outwards: a result holds every value that the
 * operation can give for numbers within its operands. An operation's rounding error is
 * at most half an ulp; one ulp is given away at each end.
 */
#ifndef INCISE_INTERVAL_H
#define INCISE_INTERVAL_H

#include <float.h>
#include <math.h>

struct interval {
	double lo, hi;
};

static inline struct interval iv_out(double lo, double hi)
{
	return (struct interval){lo - fabs(lo) * 0x1p-52 - 0x1p-1040,
				 hi + fabs(hi) * 0x1p-52 + 0x1p-1040};
}

static inline struct interval iv(double x)
{
	return (struct interval){x, x};
}

static inline struct interval iv_add(struct interval a, struct interval b)
{
	return iv_out(a.lo + b.lo, a.hi + b.hi);
}

static inline struct interval iv_sub(struct interval a, struct interval b)
{
	return iv_out(a.lo - b.hi, a.hi - b.lo);
}

/* Comparisons, not fmin() and fmax(): without NaN they agree, and they need no call. */
static inline double iv_least(double a, double b)
{
	return a < b ? a : b;
}

static inline double iv_most(double a, double b)
{
	return a > b ? a : b;
}

static inline struct interval iv_mul(struct interval a, struct interval b)
{
	double p = a.lo * b.lo, q = a.lo * b.hi, r = a.hi * b.lo, s = a.hi * b.hi;

	return iv_out(iv_least(iv_least(p, q), iv_least(r, s)),
		      iv_most(iv_most(p, q), iv_most(r, s)));
}

/* share·b for a share ≥ 0: the same ends as iv_mul(), of two products. */
static inline struct interval iv_share(struct interval share, struct interval b)
{
	return iv_out(b.lo * (b.lo < 0 ? share.hi : share.lo),
		      b.hi * (b.hi < 0 ? share.lo : share.hi));
}

static inline struct interval iv_scale(struct interval a, double k)
{
	return iv_mul(a, iv(k));
}

/* a², which is tighter than a·a where a holds 0. */
static inline struct interval iv_square(struct interval a)
{
	double lo = a.lo * a.lo, hi = a.hi * a.hi;

	if (a.lo <= 0 && a.hi >= 0)
		return iv_out(0, fmax(lo, hi));
	return iv_out(fmin(lo, hi), fmax(lo, hi));
}

/* 1/a for a > 0. */
static inline struct interval iv_inverse(struct interval a)
{
	return iv_out(1 / a.hi, 1 / a.lo);
}

/* e^a; libm's exp is good to an ulp, two more are given away. */
static inline struct interval iv_exp(struct interval a)
{
	double lo = fmin(exp(a.lo), DBL_MAX), hi = exp(a.hi);

	return (struct interval){fmax(0, lo - lo * 0x1p-50),
				 hi + hi * 0x1p-50 + 0x1p-1040};
}

static inline struct interval iv_intersect(struct interval a, struct interval b)
{
	return (struct interval){fmax(a.lo, b.lo), fmin(a.hi, b.hi)};
}

/* Largest absolute value; infinite where an end is no number. */
static inline double iv_mag(struct interval a)
{
	if (isnan(a.lo) || isnan(a.hi))
		return INFINITY;
	return fmax(fabs(a.lo), fabs(a.hi));
}

#endif
