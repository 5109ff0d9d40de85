// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integers that kernels run: springs of the plane constraint and the reaction, and the
 * motion profile of the actuator.
 */
#include <stdio.h>
#include <stdlib.h>
#include "../../lib/fixed/spring.h"
#include "../../lib/fixed/profile.h"
#include "any_pose.h"
#include "extremes.h"

#define SPRINGS 1000000
#define PROFILES 3000
#define TICKS 300

static int32_t any_integer(void)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MAX, 0, 1, -1, INT32_MIN + 1};

	return below(2) ? ends[below(6)] : (int32_t)any() >> below(31);
}

static double any_number(double scale)
{
	return below(4) ? between(-scale, scale) : below(2) ? special() : any_bits();
}

/* Of a spring as it is meant: within its certified bound of the formula. */
static void true_spring(struct extremes_row *row)
{
	double K = below(4) ? exp(between(-9, 10)) : any_number(100);
	double anchor[3], u[3], p[3], size = 0, way = 0, far = 0;
	struct incise_fixed_spring spring;
	int32_t at[3], force[3] = {0};
	bool pushes = below(2), held;
	double error = 0, bound;
	int rc;

	for (int i = 0; i < 3; i++) {
		anchor[i] = any_number(below(8) ? 100 : 40000);
		u[i] = between(-1, 1);
		size += u[i] * u[i];
	}
	for (int i = 0; i < 3; i++)
		u[i] /= sqrt(size);
	rc = incise_fixed_spring_set(&spring, K, anchor, u);
	if (rc == -22 || rc == -34) {
		row->tried++;
		row->refused++;
		return;
	}
	for (int i = 0; i < 3; i++) {
		p[i] = fmax(-32767, fmin(32767, anchor[i] + between(-60, 60)));
		at[i] = (int32_t)lrint(p[i] * 65536);
		far += (p[i] - anchor[i]) * (p[i] - anchor[i]);
		way += (p[i] - anchor[i]) * u[i];
	}
	(pushes ? incise_fixed_spring_push : incise_fixed_spring_pull)(&spring, at,
								       force);
	bound = incise_fixed_spring_bound(K, sqrt(far));
	for (int i = 0; i < 3; i++) {
		double exact = pushes && way >= 0 ? 0 : -K * way * u[i];

		error = hypot(error, force[i] * 0x1p-16 - exact);
	}
	held = !rc && error <= bound * (1 + 1e-9) + 1e-9;
	if (extremes_first_wrong(row, held))
		extremes_tell(
			row,
			"off by %a, bound %a: K %a, anchor (%a, %a, %a), u (%a, %a, %a), "
			"p (%a, %a, %a), %s, case %ld",
			error, bound, K, anchor[0], anchor[1], anchor[2], u[0], u[1],
			u[2], p[0], p[1], p[2], pushes ? "push" : "pull", row->tried);
}

/* Any integers at all: a pull along u is against the way, and nothing wraps. */
static void any_spring(struct extremes_row *row)
{
	struct incise_fixed_spring s = {.stiffness = any_integer()};
	int32_t p[3], force[3] = {0}, way;
	double exact = 0;
	bool held = true;

	for (int i = 0; i < 3; i++) {
		double off;

		s.anchor[i] = any_integer();
		s.direction[i] = any_integer();
		p[i] = any_integer();
		off = ((double)p[i] - s.anchor[i]) * 0x1p-16;
		exact += fmax(-16384, fmin(16384, off)) * (s.direction[i] * 0x1p-30);
	}
	way = incise_fixed_spring_pull(&s, p, force);
	/* Three roundings of products in Q16. */
	held = fabs(way * 0x1p-16 - fmax(-32768, fmin(32768, exact))) < 4 * 0x1p-16;
	for (int i = 0; i < 3; i++) {
		double along = -(double)way * s.direction[i];

		held = held && (s.stiffness > 0 || force[i] == 0) &&
		       (force[i] == 0 || along * force[i] > 0);
	}
	if (extremes_first_wrong(row, held))
		extremes_tell(
			row,
			"K %d, anchor (%d, %d, %d), u (%d, %d, %d), p (%d, %d, %d): way "
			"%d of %a, force (%d, %d, %d), case %ld",
			s.stiffness, s.anchor[0], s.anchor[1], s.anchor[2],
			s.direction[0], s.direction[1], s.direction[2], p[0], p[1], p[2],
			way, exact, force[0], force[1], force[2], row->tried);
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

/* The promises of lib/fixed/profile.h at the ends of ticks, whatever the targets are. */
static void run_profile(struct extremes_row *row, const struct incise_profile_limits *l)
{
	struct incise_profile profile;
	struct incise_profile_slot slot;
	const double T = l->tick_ns * 1e-9, unit = 0x1p-32;
	double before = 0, last = 0;
	int64_t steps = 0;

	if (incise_profile_init(&profile, l, 0)) {
		row->tried++;
		row->refused++;
		return;
	}
	for (int k = 0; k < TICKS; k++) {
		double to, way;

		if (!below(12))
			incise_profile_target(&profile,
					      (enum incise_profile_mode)below(3),
					      below(2) ? any_integer() : (int64_t)any());
		if (!below(60))
			incise_profile_stop(&profile);
		incise_profile_tick(&profile, &slot);
		to = (double)slot.to * unit;
		way = to - last;
		steps += (int64_t)slot.n * slot.dir;
		/* Doubles of up to 1e9 steps have 2^-23 left. */
		if (extremes_first_wrong(row,
					 fabs(way) <= l->velocity * T + 1e-6 &&
						 fabs(way - before) <=
							 l->acceleration * T * T + 1e-6 &&
						 to >= l->position_min - 1e-6 &&
						 to <= l->position_max + 1e-6 &&
						 fabs(to - (double)steps) < 1 + 1e-6 &&
						 slot.n <= (int)(l->velocity * T) + 1))
			extremes_tell(
				row,
				"tick %d: to %a by %a after %a, %d steps: tick %u ns, v %u, a "
				"%u, j %llu, %d … %d, case %ld",
				k, to, way, before, slot.n, l->tick_ns, l->velocity,
				l->acceleration, (unsigned long long)l->jerk,
				l->position_min, l->position_max, row->tried);
		before = way;
		last = to;
	}
}

void extremes_motion(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "spring",
		"plane constraint and reaction in integers: within the certified bound of the "
		"formula; of any integers: against the way, and nothing wraps");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, SPRINGS); k; k--)
		(k & 1 ? true_spring : any_spring)(row);
	row = extremes_begin(
		all, "profile",
		"the actuator's motion, any limits, any targets at any time: "
		"velocity, acceleration, travel and steps within its limits");
	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, PROFILES); k; k--) {
		struct incise_profile_limits l = any_limits();

		run_profile(row, &l);
	}
}
