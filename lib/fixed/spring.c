// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A spring along a direction, in integers; see spring.h. Whatever the numbers are,
 * the steps stay within 63 bits:
 *
 *   P - P0                 held to ±2^30
 *   (P - P0)·u             3 · 2^30 · 2^31 < 2^63   Q46, rounded to Q16, held to 31 bits
 *   K · that               2^31 · 2^31 = 2^62       Q32, rounded to Q16, held to 31 bits
 *   force · u              2^31 · 2^31 = 2^62       Q46, rounded to Q16
 *
 * Numbers are held to as much below 0 as above, so that both sides are the same.
 */
#include "spring.h"

/* P - P0 beyond this counts as this: 16384 mm. */
#define AWAY_MAX (1 << 30)

static int32_t hold(int64_t v, int32_t most)
{
	if (v > most)
		return most;
	return v < -most ? -most : (int32_t)v;
}

/* v / 2^shift to the nearest, halves away from 0. A right shift alone would floor. */
static int64_t rounded(int64_t v, int shift)
{
	int64_t half = (int64_t)1 << (shift - 1);

	return v < 0 ? -((-v + half) >> shift) : (v + half) >> shift;
}

/* (P - P0)·u */
static int32_t along(const struct incise_fixed_spring *spring, const int32_t p[3])
{
	int64_t sum = 0;

	for (int i = 0; i < 3; i++) {
		int32_t away = hold((int64_t)p[i] - spring->anchor[i], AWAY_MAX);

		sum += (int64_t)away * spring->direction[i];
	}
	return hold(rounded(sum, 30), INT32_MAX);
}

static void add_force(const struct incise_fixed_spring *spring, int32_t stretch,
		      int32_t force[3])
{
	/* One that pushed away from its anchor would drive the hand. */
	int32_t stiffness = spring->stiffness < 0 ? 0 : spring->stiffness;
	/* Held before it is split, so that its direction stays. */
	int32_t back = hold(rounded((int64_t)stiffness * stretch, 16), INT32_MAX);

	for (int i = 0; i < 3; i++)
		force[i] =
			hold(force[i] - rounded((int64_t)back * spring->direction[i], 30),
			     INT32_MAX);
}

int32_t incise_fixed_spring_pull(const struct incise_fixed_spring *spring,
				 const int32_t p[3], int32_t force[3])
{
	int32_t stretch = along(spring, p);

	add_force(spring, stretch, force);
	return stretch;
}

int32_t incise_fixed_spring_push(const struct incise_fixed_spring *spring,
				 const int32_t p[3], int32_t force[3])
{
	int32_t stretch = along(spring, p);

	if (stretch < 0)
		add_force(spring, stretch, force);
	return stretch;
}
