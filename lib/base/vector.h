/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Vectors of three doubles.
 */
#ifndef INCISE_VECTOR_H
#define INCISE_VECTOR_H

#include <math.h>
#include <stdbool.h>

static inline double v3_dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double v3_length(const double a[3])
{
	return sqrt(v3_dot(a, a));
}

static inline void v3_copy(double to[3], const double a[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i];
}

static inline void v3_sub(double to[3], const double a[3], const double b[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i] - b[i];
}

/* to = a + s b; to may be a. */
static inline void v3_add(double to[3], const double a[3], double s, const double b[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i] + s * b[i];
}

/* to is neither a nor b. */
static inline void v3_cross(double to[3], const double a[3], const double b[3])
{
	to[0] = a[1] * b[2] - a[2] * b[1];
	to[1] = a[2] * b[0] - a[0] * b[2];
	to[2] = a[0] * b[1] - a[1] * b[0];
}

static inline bool v3_finite(const double a[3])
{
	return isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
}

/*
 * Make a unit vector of a vector longer than @least; else leave @to as it is, and return
 * false.
 */
static inline bool v3_unit(double to[3], const double a[3], double least)
{
	double length = v3_length(a);

	if (!(length > least) || !isfinite(length))
		return false;
	for (int i = 0; i < 3; i++)
		to[i] = a[i] / length;
	return true;
}

/* Any direction at right angles to a unit vector: across the axis that is least along it. */
static inline void v3_any_across(double to[3], const double unit[3])
{
	double axis[3] = {0}, across[3];
	int least = 0;

	for (int i = 1; i < 3; i++)
		if (fabs(unit[i]) < fabs(unit[least]))
			least = i;
	axis[least] = 1;
	v3_cross(across, axis, unit);
	/* Longer than √(2/3). */
	v3_unit(to, across, 0);
}

/* Turn by a unit quaternion, w first; to is not v. */
static inline void v3_rotate(double to[3], const double q[4], const double v[3])
{
	double t[3], u[3];

	v3_cross(t, q + 1, v);
	v3_add(t, t, 1, t);
	v3_cross(u, q + 1, t);
	for (int i = 0; i < 3; i++)
		to[i] = v[i] + q[0] * t[i] + u[i];
}

#endif
