// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Limits of force and slew; see limit.h.
 */
#include <float.h>
#include <stdbool.h>
#include "../base/vector.h"
#include "limit.h"

/* A limit above this is this: squares of anything within it are finite. */
#define LARGE_N 1e100

/*
 * Scaling rounds each component, and the length of it rounds again: 4 roundings of half
 * an ulp. Aiming lower by twice as much keeps what is computed below the limit.
 */
#define AIM (1 - 4 * DBL_EPSILON)

static double setting(double value)
{
	return value > 0 ? fmin(value, LARGE_N) : 0;
}

/* Shorten @v to @most if it is longer; the squares of huge components would overflow. */
static bool shorten(double v[3], double most)
{
	double largest = fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2]));
	double unit[3];
	double length;

	if (largest <= most && v3_length(v) <= most)
		return false;
	for (int i = 0; i < 3; i++)
		unit[i] = v[i] / largest;
	length = v3_length(unit);
	for (int i = 0; i < 3; i++)
		v[i] = unit[i] * (most / length * AIM);
	return true;
}

unsigned int incise_limit_apply(struct incise_limit *limit, double force_N[3])
{
	double most_N = setting(limit->force_N), slew_N = setting(limit->slew_N);
	unsigned int events = 0;
	double change[3];

	if (!v3_finite(force_N)) {
		events |= INCISE_LIMIT_NOT_FINITE;
		v3_copy(force_N, (const double[3]){0, 0, 0});
	}
	if (shorten(force_N, most_N))
		events |= INCISE_LIMIT_FORCE;
	if (!v3_finite(limit->last_N))
		incise_limit_zero(limit);
	v3_sub(change, force_N, limit->last_N);
	if (shorten(change, slew_N)) {
		events |= INCISE_LIMIT_SLEW;
		v3_add(force_N, limit->last_N, 1, change);
		/* Between two forces within the limit, but for rounding. */
		shorten(force_N, most_N);
	}
	v3_copy(limit->last_N, force_N);
	return events;
}

void incise_limit_zero(struct incise_limit *limit)
{
	v3_copy(limit->last_N, (const double[3]){0, 0, 0});
}
