/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A plan on a ground that is run by fed poses. Each tick is checked: finite, force and
 * its change within the limits, phase and tool what they can be.
 */
#ifndef INCISE_TEST_FED_RUN_H
#define INCISE_TEST_FED_RUN_H

#include <float.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"
#include "ground.h"

#define MS 1000000
#define YEAR_NS 31557600000000000

/* Conditions that must have been met for the test to mean anything. */
enum met {
	MET_CONTACT,
	MET_INSERTION,
	MET_CLAMPED,
	MET_SLEWED,
	MET_STALE,
	MET_GUARDED,
	MET_EXTRAPOLATED,
	MET_STARTING,
	MET_ON_SURFACE, /* a depth of 0 in contact, to the bit */
	MET_ON_PROXY,	/* tool and proxy in one place, to the bit */
	MET_AT_AGE,	/* a pose as old as may be, to the ns, or 1 ns more or less */
	MET_NO_TIME,	/* two ticks at one time */
	MET_YEARS,
	MET_HANDLE,
	MET_TUBE,
	MET_RECOVERED,
	METS,
};

/* A run on one scene. */
struct run {
	char what[80];
	const struct ground *ground;
	struct incise_plan *plan;
	struct incise_touch top;
	enum incise_tool tool; /* what is gone back to */
	int64_t t_ns;
	long ticks;
	struct incise_tick tick; /* the last one */
	double last_N[3];
	bool waved;				     /* in free air */
	double at_mm[3], speed_mm_s[3], attitude[4]; /* of a stroke */
};

static uint64_t seed = 1;
static long n_poses, n_ticks, met[METS];

/* Says all that it takes to see it again. */
#define FAIL(run, ...)                                                             \
	do {                                                                       \
		print_error("seed %llu, %s, tick %ld: ", (unsigned long long)seed, \
			    (run)->what, (run)->ticks);                            \
		fail_msg(__VA_ARGS__);                                             \
	} while (0)

static inline void check_tick(struct run *run, const struct incise_tick *before)
{
	const struct incise_tick *t = &run->tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;
	double change[3];

	if (!v3_finite(t->position_mm) || !v3_finite(t->tool_mm) ||
	    !v3_finite(t->proxy_mm) || !v3_finite(t->normal) ||
	    !v3_finite(t->command_N) || !isfinite(t->depth_mm) ||
	    !isfinite(t->velocity_mm_s) || !isfinite(t->rendered_N))
		FAIL(run, "not finite");
	if (t->flags & (INCISE_TICK_NOT_FINITE | INCISE_TICK_FAULT) ||
	    t->flags >> INCISE_TICK_FLAGS)
		FAIL(run, "flags %#x", t->flags);
	if (!(v3_length(t->command_N) <= GROUND_FORCE_N))
		FAIL(run, "force of %.17g N", v3_length(t->command_N));
	v3_sub(change, t->command_N, run->last_N);
	/* What limit.h allows for rounding. */
	if (!(v3_length(change) <= GROUND_SLEW_N + 8 * DBL_EPSILON * GROUND_FORCE_N))
		FAIL(run, "change of %.17g N", v3_length(change));
	v3_copy(run->last_N, t->command_N);
	if ((unsigned int)t->phase > INCISE_PHASE_INSERTION ||
	    (t->tool != INCISE_TOOL_BLADE && t->tool != INCISE_TOOL_HANDLE &&
	     t->tool != INCISE_TOOL_TUBE))
		FAIL(run, "phase %d, tool %d", t->phase, t->tool);
	if (t->phase != (!contact			? INCISE_PHASE_FREE
			 : t->tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
							: INCISE_PHASE_INSERTION))
		FAIL(run, "phase %d, tool %d, flags %#x", t->phase, t->tool, t->flags);
	if (before->flags & INCISE_TICK_CONTACT && t->tool != before->tool)
		FAIL(run, "tool %d became %d in the tissue", before->tool, t->tool);
	if (contact && t->flags & INCISE_TICK_STALE)
		FAIL(run, "contact by an old pose");
	/* Of unit length, but for some roundings. */
	if (contact && !(fabs(v3_length(t->normal) - 1) < 1e-12))
		FAIL(run, "normal of length %.17g", v3_length(t->normal));
	if (!(t->depth_mm >= 0))
		FAIL(run, "depth %.17g", t->depth_mm);
	/* The slew is wide enough for a damping that follows a hand. */
	if (run->waved && v3_length(t->command_N) >
				  run->plan->guard->cap_N_s_mm * t->velocity_mm_s + 1e-9)
		FAIL(run, "%g N at %g mm/s in free air", v3_length(t->command_N),
		     t->velocity_mm_s);
}

static inline void count(const struct run *run)
{
	const struct incise_tick *t = &run->tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;

	met[MET_CONTACT] += contact;
	met[MET_INSERTION] += t->phase == INCISE_PHASE_INSERTION;
	met[MET_CLAMPED] += !!(t->flags & INCISE_TICK_CLAMPED);
	met[MET_SLEWED] += !!(t->flags & INCISE_TICK_SLEWED);
	met[MET_STALE] += !!(t->flags & INCISE_TICK_STALE);
	met[MET_GUARDED] += !!(t->flags & INCISE_TICK_GUARDED);
	met[MET_EXTRAPOLATED] += !!(t->flags & INCISE_TICK_EXTRAPOLATED);
	met[MET_STARTING] += !!(t->flags & INCISE_TICK_STARTING);
	met[MET_ON_SURFACE] += contact && run->plan->proxy.touch.depth_mm == 0;
	met[MET_ON_PROXY] += contact && t->tool_mm[0] == t->proxy_mm[0] &&
			     t->tool_mm[1] == t->proxy_mm[1] &&
			     t->tool_mm[2] == t->proxy_mm[2];
	met[MET_HANDLE] += t->tool == INCISE_TOOL_HANDLE;
	met[MET_TUBE] += t->tool == INCISE_TOOL_TUBE;
}

static inline void tick_at(struct run *run, int64_t t_ns)
{
	double dt_ns = (double)t_ns - (double)run->t_ns;
	struct incise_tick before = run->tick;

	met[MET_NO_TIME] += t_ns == run->t_ns;
	met[MET_YEARS] += dt_ns > YEAR_NS;
	run->t_ns = t_ns;
	run->ticks++;
	n_ticks++;
	if (incise_plan_tick(run->plan, t_ns, &run->tick))
		FAIL(run, "fault");
	check_tick(run, &before);
	count(run);
}

/* Time ends. */
static inline void step(struct run *run, int64_t dt_ns)
{
	bool ends = run->t_ns > 0 && dt_ns > INT64_MAX - run->t_ns;

	tick_at(run, ends ? INT64_MAX : run->t_ns + dt_ns);
}

static inline void feed(struct run *run, int64_t t_ns, const double position_mm[3],
			const double quaternion[4])
{
	struct incise_tracker_sample s = {
		.t_ns = t_ns, .seq = (uint64_t)n_poses, .status = ' '};

	memcpy(s.position_mm, position_mm, sizeof(s.position_mm));
	memcpy(s.quaternion, quaternion, sizeof(s.quaternion));
	n_poses += incise_plan_feed(run->plan, &s, 1);
}

/* Some way along the normal at the top: < 0 is into the tissue. */
static inline void above_top(const struct run *run, double height_mm, double p[3])
{
	for (int i = 0; i < 3; i++)
		p[i] = run->top.point_mm[i] +
		       (height_mm == 0 ? height_mm : height_mm * run->top.normal[i]);
}

/* Hold the end of whatever is held there for some time, by a good tracker. */
static inline void hold(struct run *run, const double end_mm[3], const double attitude[4],
			int ticks)
{
	double axis[3], p[3];

	for (int i = 0; i < ticks; i++) {
		v3_copy(p, end_mm);
		v3_rotate(axis, attitude, (const double[3]){0, 0, 1});
		if (run->tick.tool == INCISE_TOOL_HANDLE)
			v3_add(p, p, -GROUND_HANDLE_MM, axis);
		if (i % 8 == 0)
			feed(run, run->t_ns, p, attitude);
		step(run, MS);
	}
}

#endif
