// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integers that kernels run: reaction and plane constraint at any numbers, and the motion profile
 * of the actuator.
 */
#include <string.h>
#include "../../lib/fixed/plan.h"
#include "../../lib/fixed/profile.h"
#include "../unit/fixed/profile_watch.h"
#include "extremes.h"
#include "numbers.h"

#define TICKS 300

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

static struct incise_profile_limits any_limits(void)
{
	struct incise_profile_limits l = {
		.tick_ns = INCISE_PROFILE_TICK_MIN_NS +
			   below(INCISE_PROFILE_TICK_MAX_NS - INCISE_PROFILE_TICK_MIN_NS),
		.velocity = 1 + below(INCISE_PROFILE_VELOCITY_MAX),
		.acceleration = 1 + (uint32_t)exp(between(0, 22)),
		.position_min = -(int32_t)below(INCISE_PROFILE_POSITION_MAX),
		.position_max = (int32_t)below(INCISE_PROFILE_POSITION_MAX),
	};

	if (below(2)) /* an average of up to 256 ticks */
		l.jerk = (uint64_t)(2e9 * l.acceleration / l.tick_ns / (1 + below(255))) +
			 1;
	if (!below(6))
		l.velocity = (uint32_t)any_integer();
	if (!below(6))
		l.tick_ns = (uint32_t)any_integer();
	if (!below(6))
		l.position_max = any_integer();
	return l;
}

/* Each tick holds the limits of lib/fixed/profile.h, with any targets. */
static void try_profile(struct extremes_row *row, const struct property *property)
{
	struct incise_profile_limits l = any_limits();
	struct incise_profile_slot slot;
	struct incise_profile profile;
	struct watch watch;

	if (incise_profile_init(&profile, &l, 0)) {
		extremes_refused_plainly(row);
		return;
	}
	watch_begin(&watch, &l, 0);
	for (int k = 0; k < TICKS; k++) {
		const char *wrong;

		if (!below(12))
			incise_profile_target(&profile,
					      (enum incise_profile_mode)below(3),
					      below(2) ? any_integer() : (int64_t)any());
		if (!below(60))
			incise_profile_stop(&profile);
		incise_profile_tick(&profile, &slot);
		wrong = watch_tick(&watch, &profile, &slot);
		extremes_check(row, !wrong,
			       "%s: tick %d of %u ns, v %u, a %u, j %llu, %d … %d", wrong,
			       k, l.tick_ns, l.velocity, l.acceleration,
			       (unsigned long long)l.jerk, l.position_min,
			       l.position_max);
	}
}

const struct property motion_properties[] = {
	{"reaction_plane",
	 "reaction and plane constraint of any integers: the formula, rounded and held, "
	 "to the bit",
	 500000, .each = try_forces},
	{"profile",
	 "the actuator's motion, any limits, any targets at any time: "
	 "velocity, acceleration, travel and steps within its limits",
	 3000, .each = try_profile},
	{0},
};
