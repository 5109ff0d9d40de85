/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Numbers and turns that no tracker should send, the same in every run: for incise bench
 * extremes and the unit tests. Each source that includes it has a generator of its own.
 */
#ifndef INCISE_ANY_POSE_H
#define INCISE_ANY_POSE_H

#include <float.h>
#include <math.h>
#include <stdint.h>

static uint64_t rng = 1; /* not 0 */

static inline uint64_t any(void)
{
	rng ^= rng << 13;
	rng ^= rng >> 7;
	rng ^= rng << 17;
	return rng * 0x2545f4914f6cdd1d;
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

static inline double special(void)
{
	static const double values[] = {
		0,	 -0.0,		NAN,	     -NAN,	   INFINITY, -INFINITY,
		DBL_MAX, -DBL_MAX,	DBL_MIN,     DBL_TRUE_MIN, 1,	     -DBL_MIN,
		-1,	 -DBL_TRUE_MIN, DBL_EPSILON, 1e4,	   -1e4,     1e308,
		0x1p31,	 -32768,	9999.9999,   1e-160,	   1e160,    1e5,
		20,	 32767,		0x1p-1022,   0x1p53,	   -0x1p63,  1e-300,
	};
	const size_t n = sizeof(values) / sizeof(*values);

	return below(8) ? values[below((uint32_t)n)] : nextafter(1e4, below(2) ? 0 : 2e4);
}

/* A turn of the scalpel; sometimes just where blade and handle part, or none at all. */
static inline void any_attitude(double q[4])
{
	static const double lengths[] = {0, DBL_TRUE_MIN, 0.9, 1.1, 1, 2};
	double length = 1;

	switch (below(8)) {
	case 0:
		for (int i = 0; i < 4; i++)
			q[i] = special();
		return;
	case 1:
		for (int i = 0; i < 4; i++)
			q[i] = any_bits();
		return;
	case 2:
		/* About x: the axis' z is 1 - 2 sin², to the ulp at ±0.2. */
		q[1] = sqrt(below(2) ? 0.4 : 0.6);
		for (int n = (int)below(4); n; n--)
			q[1] = nextafter(q[1], below(2) ? 0 : 1);
		q[0] = sqrt(1 - q[1] * q[1]);
		q[2] = q[3] = 0;
		return;
	case 3:
		length = lengths[below(6)];
		length = nextafter(length, below(2) ? 0 : 3);
		break;
	default:
		break;
	}
	do {
		for (int i = 0; i < 4; i++)
			q[i] = between(-1, 1);
	} while (!(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-3));
	length /= sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
	for (int i = 0; i < 4; i++)
		q[i] *= length;
}

#endif
