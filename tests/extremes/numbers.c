// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Numbers and attitudes that no device should send; see numbers.h.
 */
#include <stddef.h>
#include "numbers.h"

uint64_t any_state = 1;

double special(void)
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

double any_number(uint32_t odds, double low, double high)
{
	switch (below(odds)) {
	case 0:
		return special();
	case 1:
		return any_bits();
	default:
		return between(low, high);
	}
}

int32_t any_integer(void)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MAX, 0, 1, -1, INT32_MIN + 1};

	return below(2) ? ends[below(6)] : (int32_t)any() >> below(31);
}

void any_attitude(double q[4])
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
