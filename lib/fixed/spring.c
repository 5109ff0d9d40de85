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

/* (P - P0)·u */
static int32_t along(const struct incise_fixed_spring *spring, const int32_t p[3])
{
	int32_t away[3];

	incise_fx_sub(away, p, spring->anchor);
	return incise_fx_along(away, spring->direction);
}

static void add_force(const struct incise_fixed_spring *spring, int32_t stretch,
		      int32_t force[3])
{
	/* One that pushed away from its anchor would drive the hand. */
	int32_t stiffness = spring->stiffness < 0 ? 0 : spring->stiffness;
	/* Held before it is split, so that its direction stays. */
	incise_fx_add(force, force, -incise_fx_times(stiffness, stretch),
		      spring->direction);
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
