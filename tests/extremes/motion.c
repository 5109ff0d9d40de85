// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integers that kernels run: reaction and plane constraint at any numbers. The motion profile of the
 * actuator is in ../unit/fixed/profile.c.
 */
#include <string.h>
#include "../../lib/fixed/plan.h"
#include "extremes.h"
#include "numbers.h"

static int32_t any_corner(void)
{
	static const int32_t corners[] = {
		INT32_MIN, INT32_MIN + 1, -(1 << 30) - 1, -(1 << 30),	 -1,	    0,
		1,	   1 << 30,	  (1 << 30) + 1,  INT32_MAX - 1, INT32_MAX,
	};

	return below(2) ? corners[below(11)] : (int32_t)any() >> below(31);
}

static long double held(long double v, long double most)
{
	return roundl(fmaxl(-most, fminl(most, v)));
}

/* A spring's force in long double, whose 64 bits of mantissa hold all products. */
static void pull(int32_t force[3], int32_t stiffness, int32_t stretch, const int32_t u[3])
{
	long double size = held((long double)stiffness * stretch * 0x1p-16L, INT32_MAX);

	for (int i = 0; i < 3; i++)
		force[i] = (int32_t)held(force[i] - roundl(size * u[i] * 0x1p-30L),
					 INT32_MAX);
}

/* Reaction and plane of any integers, added to some force. */
static void try_forces(struct extremes_row *row, const struct property *property)
{
	static struct incise_fixed_state s;
	struct incise_fixed_tick tick = {.phase = INCISE_PHASE_CUTTING};
	struct incise_fixed_plan plan = {.numbers = {.reaction = any_corner() & INT32_MAX,
						     .plane = any_corner() & INT32_MAX}};
	long double stretch = 0;
	int32_t right[3];

	s.depth = any_corner() & INT32_MAX;
	for (int i = 0; i < 3; i++) {
		s.p0[i] = any_corner();
		s.normal[i] = any_corner();
		s.side[i] = any_corner();
		tick.tool[i] = any_corner();
		s.force[i] = right[i] = s.p0[i] ^ s.side[i];
		stretch += held((long double)tick.tool[i] - s.p0[i], 0x1p30L) * s.side[i];
	}
	pull(right, plan.numbers.reaction, -s.depth, s.normal);
	pull(right, plan.numbers.plane, (int32_t)held(stretch * 0x1p-30L, INT32_MAX),
	     s.side);
	incise_fixed_stage_reaction(&plan, &s, &tick);
	incise_fixed_stage_plane(&plan, &s, &tick);
	extremes_check(
		row, !memcmp(s.force, right, sizeof(right)),
		"K %d and %d, depth %d, n (%d, %d, %d), P0 (%d, %d, %d), s (%d, %d, "
		"%d), P (%d, %d, %d): force (%d, %d, %d), not (%d, %d, %d)",
		plan.numbers.reaction, plan.numbers.plane, s.depth, V3_OF(s.normal),
		V3_OF(s.p0), V3_OF(s.side), V3_OF(tick.tool), V3_OF(s.force),
		V3_OF(right));
}

const struct property motion_properties[] = {
	{"reaction_plane",
	 "reaction and plane constraint of any integers: the formula, rounded and held, "
	 "to the bit",
	 500000, .each = try_forces},
	{0},
};
