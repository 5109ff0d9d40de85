// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integers that kernels run: springs of the plane constraint and the reaction, and the
 * motion profile of the actuator.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/fixed/profile.h"
#include "../unit/fixed/profile_watch.h"
#include "extremes.h"
#include "fixed_spring.h"
#include "numbers.h"

#define TICKS 300

static double number(double scale)
{
	return below(4) ? between(-scale, scale) : below(2) ? special() : any_bits();
}

/* |F^ - F|, F = -K [(p - anchor)·u] u, of a spring that pulls or, inside only, pushes. */
static double force_error(const struct incise_fixed_spring *spring, bool pushes, double K,
			  const double p[3], const double anchor[3], const double u[3])
{
	int32_t at[3], force[3] = {0};
	double error = 0, way = 0;

	for (int i = 0; i < 3; i++) {
		at[i] = (int32_t)lrint(p[i] * 65536);
		way += (p[i] - anchor[i]) * u[i];
	}
	(pushes ? incise_fixed_spring_push : incise_fixed_spring_pull)(spring, at, force);
	for (int i = 0; i < 3; i++) {
		double exact = pushes && way >= 0 ? 0 : -K * way * u[i];

		error = hypot(error, force[i] * 0x1p-16 - exact);
	}
	return error;
}

/* A spring as it is meant: within its certified bound of the formula. */
static void try_true_spring(struct extremes_row *row)
{
	double K = below(4) ? exp(between(-9, 10)) : number(100);
	double anchor[3], u[3], p[3], size = 0, far = 0, error, bound;
	struct incise_fixed_spring spring;
	bool pushes = below(2);
	int rc;

	for (int i = 0; i < 3; i++) {
		anchor[i] = number(below(8) ? 100 : 40000);
		u[i] = between(-1, 1);
		size += u[i] * u[i];
	}
	for (int i = 0; i < 3; i++)
		u[i] /= sqrt(size);
	rc = incise_fixed_spring_set(&spring, K, anchor, u);
	if (rc == -EINVAL || rc == -ERANGE) {
		extremes_refused_plainly(row);
		return;
	}
	for (int i = 0; i < 3; i++) {
		p[i] = fmax(-32767, fmin(32767, anchor[i] + between(-60, 60)));
		far += (p[i] - anchor[i]) * (p[i] - anchor[i]);
	}
	error = force_error(&spring, pushes, K, p, anchor, u);
	bound = incise_fixed_spring_bound(K, sqrt(far));
	extremes_check(row, !rc && error <= bound * (1 + 1e-9) + 1e-9,
		       "off by %a, bound %a: K %a, anchor " V3 ", u " V3 ", p " V3 ", %s",
		       error, bound, K, V3_OF(anchor), V3_OF(u), V3_OF(p),
		       pushes ? "push" : "pull");
}

static long double held(long double v, long double most)
{
	return fmaxl(-most, fminl(most, v));
}

/* As the header has it, in long double, whose 64 bits of mantissa hold all products. */
static int32_t expected(const struct incise_fixed_spring *s, const int32_t p[3],
			bool pushes, int32_t force[3])
{
	long double sum = 0, stretch, back;

	for (int i = 0; i < 3; i++)
		sum += held((long double)p[i] - s->anchor[i], 0x1p30L) * s->direction[i];
	stretch = held(roundl(sum * 0x1p-30L), INT32_MAX);
	back = fmaxl(0, s->stiffness) * stretch * 0x1p-16L;
	back = held(roundl(back), INT32_MAX);
	for (int i = 0; i < 3 && (stretch < 0 || !pushes); i++) {
		long double part = roundl(back * s->direction[i] * 0x1p-30L);

		force[i] = (int32_t)held(force[i] - part, INT32_MAX);
	}
	return (int32_t)stretch;
}

/* Mirrored at its anchor, a spring does the opposite, to the bit. */
static bool same_on_both_sides(struct incise_fixed_spring s, const int32_t p[3])
{
	int32_t at[3], mirrored[3], force[3] = {0}, back[3] = {0};

	for (int i = 0; i < 3; i++) {
		s.anchor[i] /= 4;
		at[i] = s.anchor[i] + p[i] / 4;
		mirrored[i] = s.anchor[i] - p[i] / 4;
	}
	return incise_fixed_spring_pull(&s, at, force) ==
		       -incise_fixed_spring_pull(&s, mirrored, back) &&
	       force[0] == -back[0] && force[1] == -back[1] && force[2] == -back[2];
}

static int32_t any_corner(void)
{
	static const int32_t corners[] = {
		INT32_MIN, INT32_MIN + 1, -(1 << 30) - 1, -(1 << 30),	 -1,	    0,
		1,	   1 << 30,	  (1 << 30) + 1,  INT32_MAX - 1, INT32_MAX,
	};

	return below(2) ? corners[below(11)] : (int32_t)any() >> below(31);
}

/* A spring of any integers, some force added to. */
static void try_any_spring(struct extremes_row *row)
{
	struct incise_fixed_spring s = {.stiffness = any_corner()};
	int32_t p[3], force[3], right[3], stretch, right_stretch;
	bool pushes = row->tried % 4;

	for (int i = 0; i < 3; i++) {
		s.anchor[i] = any_corner();
		s.direction[i] = any_corner();
		p[i] = any_corner();
		force[i] = right[i] = s.anchor[i] ^ s.direction[i];
	}
	right_stretch = expected(&s, p, pushes, right);
	stretch = (pushes ? incise_fixed_spring_push : incise_fixed_spring_pull)(&s, p,
										 force);
	extremes_check(row,
		       stretch == right_stretch && !memcmp(force, right, sizeof(right)) &&
			       same_on_both_sides(s, p),
		       "K %d, anchor (%d, %d, %d), u (%d, %d, %d), p (%d, %d, %d), %s: "
		       "stretch %d, not %d, force (%d, %d, %d), not (%d, %d, %d), or not "
		       "the opposite on the other side",
		       s.stiffness, V3_OF(s.anchor), V3_OF(s.direction), V3_OF(p),
		       pushes ? "push" : "pull", stretch, right_stretch, V3_OF(force),
		       V3_OF(right));
}

static void try_springs(struct extremes_row *row, const struct property *property)
{
	try_any_spring(row);
	try_true_spring(row);
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
	{"spring",
	 "plane constraint and reaction in integers: within the certified bound of the "
	 "formula; of any integers: against the way, and nothing wraps",
	 500000, .each = try_springs},
	{"profile",
	 "the actuator's motion, any limits, any targets at any time: "
	 "velocity, acceleration, travel and steps within its limits",
	 3000, .each = try_profile},
	{0},
};
