// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Inputs of a model in integers; see input.h. With |v| ≤ 10^4 mm/s (2^29.3 in Q16) and |a| ≤ 10^5
 * mm/s² (2^28.7 in Q12) steps stay within 63 bits:
 *
 *   v · a            3 · 2^29.3 · 2^28.7 < 2^59.6    Q28
 *   that / |v|       Q12
 *   ns · 2^16        2^45 · 2^16 = 2^61
 *
 * and with a speed |v| ≤ 2^30.1 that of a path, in 2^14 ns of Q16 mm/s:
 *
 *   |v| · ns         2^30.1 · 2^32 = 2^62.1
 *   its sum · 2      2^30.1 · 2^45 / 2^13 = 2^62.1
 */
#include "plan.h"
#include "vector.h"

#define ONE (1 << 16)
#define LONGEST_NS ((int64_t)1 << 45) /* 35 000 s, more than Q16.16 holds */

int32_t incise_fixed_input_acceleration(const int32_t velocity[3],
					const int64_t acceleration[3])
{
	uint32_t speed = incise_fx_length(velocity);
	int64_t sum = 0;

	/* Below 5 mm/s the direction of the motion is not known. */
	if (speed < 5 * ONE)
		speed = 5 * ONE;
	for (int i = 0; i < 3; i++)
		sum += velocity[i] * incise_fx_rounded(acceleration[i], 4);
	return incise_fx_hold32(div64_s64(sum, speed) * 16);
}

/* atan 2^-k, Q24 degrees */
static const int32_t turn[] = {
	754974720, 445687602, 235489088, 119537938, 60000934, 30029717, 15018523,
	7509720,   3754917,   1877466,	 938734,    469367,   234684,	117342,
	58671,	   29335,     14668,	 7334,	    3667,     1833,	917,
	458,	   229,	      115,	 57,	    29,	      14,	7,
};

/*
 * atan2(y, x) in the first quadrant, Q16.16 degrees, by CORDIC (Volder 1959): the vector is turned
 * to the x axis by ever smaller angles whose tangents are powers of two.
 */
static int32_t turn_of(int64_t x, int64_t y)
{
	int64_t angle = 0;

	/* Q38, so that the bits shifted out do not count. */
	x *= 256;
	y *= 256;
	for (int k = 0; k < (int)(sizeof(turn) / sizeof(*turn)); k++) {
		int64_t along = x >> k, across = y >> k;

		x += y > 0 ? across : -across;
		angle += y > 0 ? turn[k] : -turn[k];
		y -= y > 0 ? along : -along;
	}
	return (int32_t)incise_fx_rounded(angle, 8);
}

int32_t incise_fixed_input_tilt(const int32_t axis[3], const int32_t normal[3])
{
	int32_t across[3], along = incise_fx_dot(axis, normal);
	uint32_t size;

	incise_fx_cross(across, axis, normal);
	size = incise_fx_length(across);
	if (along < 0)
		return 180 * ONE - turn_of(-(int64_t)along, size);
	return turn_of(along, size);
}

int32_t incise_fixed_input_time(int64_t t_ns, int64_t from_ns)
{
	uint64_t gone = (uint64_t)t_ns - (uint64_t)from_ns;

	if (t_ns <= from_ns)
		return 0;
	if (gone > (uint64_t)LONGEST_NS)
		gone = (uint64_t)LONGEST_NS;
	return incise_fx_hold32(div64_s64((int64_t)gone * ONE, 1000000000));
}

#define PATH_BITS 14

int64_t incise_fixed_input_path(int64_t path, int32_t speed, int64_t from_ns,
				int64_t t_ns)
{
	uint64_t gone = (uint64_t)t_ns - (uint64_t)from_ns;

	if (t_ns <= from_ns)
		return path;
	if (gone > INCISE_INPUT_GAP_NS)
		gone = INCISE_INPUT_GAP_NS;
	path += incise_fx_rounded((int64_t)gone * speed, PATH_BITS);
	return path < (int64_t)1 << 61 ? path : (int64_t)1 << 61;
}

int32_t incise_fixed_input_mean_speed(int64_t path, int32_t speed, int64_t from_ns,
				      int64_t t_ns)
{
	uint64_t gone = (uint64_t)t_ns - (uint64_t)from_ns;

	if (t_ns <= from_ns)
		return speed;
	if (gone > (uint64_t)LONGEST_NS)
		gone = (uint64_t)LONGEST_NS;
	if (gone >> 32)
		return incise_fx_hold32(
			div64_s64(path * 2, (int64_t)(gone >> (PATH_BITS - 1))));
	return incise_fx_hold32(div64_s64(path * (1 << PATH_BITS), (int64_t)gone));
}
