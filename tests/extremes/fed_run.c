// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan that is run by fed poses; see fed_run.h.
 */
#include <float.h>
#include <string.h>
#include "../../lib/base/vector.h"
#include "fed_run.h"

#define POSE_TICKS 8 /* 125 poses a second */

void fed_run_begin(struct fed_run *run, struct extremes_row *row,
		   const struct ground *ground, const struct incise_scene *scene,
		   int64_t t_ns)
{
	*run = (struct fed_run){.row = row, .ground = ground, .t_ns = t_ns};
	run->plan = ground_plan(scene);
	incise_plan_top(run->plan, &run->top);
}

void fed_run_end(struct fed_run *run)
{
	incise_plan_free(run->plan);
}

bool fed_run_feed(struct fed_run *run, int64_t t_ns, const double position_mm[3],
		  const double quaternion[4])
{
	struct incise_tracker_sample s = {.t_ns = t_ns, .status = ' ', .station = 1};

	memcpy(s.position_mm, position_mm, sizeof(s.position_mm));
	memcpy(s.quaternion, quaternion, sizeof(s.quaternion));
	return incise_plan_feed(run->plan, &s, 1);
}

static bool is_finite(const struct incise_tick *t)
{
	return v3_finite(t->position_mm) && v3_finite(t->tool_mm) &&
	       v3_finite(t->proxy_mm) && v3_finite(t->normal) &&
	       v3_finite(t->command_N) && isfinite(t->depth_mm) &&
	       isfinite(t->velocity_mm_s) && isfinite(t->rendered_N[0]);
}

static bool is_within_limits(const struct incise_tick *t, const struct incise_tick *was)
{
	double change[3];

	v3_sub(change, t->command_N, was->command_N);
	/* limit.h allows so much for rounding. */
	return v3_length(t->command_N) <= GROUND_FORCE_N &&
	       v3_length(change) <= GROUND_SLEW_N + 8 * DBL_EPSILON * GROUND_FORCE_N;
}

/* The first rule that a tick breaks, or NULL. */
static const char *fault_of(const struct fed_run *run, const struct incise_tick *was)
{
	const struct incise_tick *t = &run->tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;
	bool known = t->tool == INCISE_TOOL_BLADE || t->tool == INCISE_TOOL_HANDLE ||
		     t->tool == INCISE_TOOL_TUBE;
	enum incise_phase phase = !contact			 ? INCISE_PHASE_FREE
				  : t->tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
								 : INCISE_PHASE_INSERTION;

	if (!is_finite(t))
		return "not finite";
	if (t->flags & (INCISE_TICK_NOT_FINITE | INCISE_TICK_FAULT) ||
	    t->flags >> INCISE_TICK_FLAGS)
		return "flags";
	if (!is_within_limits(t, was))
		return "beyond its limits";
	if (!known || t->phase != phase)
		return "wrong phase or tool";
	if (v3_length(was->command_N) > 0 && was->flags & INCISE_TICK_CONTACT &&
	    t->tool != was->tool)
		return "another tool in the tissue before the force had faded";
	if (contact && t->flags & INCISE_TICK_STALE)
		return "contact by an old pose";
	/* In integers it has 30 bits. */
	if (contact && !(fabs(v3_length(t->normal) - 1) < 1e-8))
		return "normal not of length 1";
	if (!(t->depth_mm >= 0))
		return "negative depth";
	if (run->waved && v3_length(t->command_N) > 0)
		return "a force in free air";
	return NULL;
}

void fed_run_tick(struct fed_run *run, int64_t t_ns)
{
	struct incise_tick was = run->tick, *t = &run->tick;
	int rc = incise_plan_tick(run->plan, t_ns, t);
	const char *fault = rc ? "failed" : fault_of(run, &was);

	run->t_ns = t_ns;
	run->contacts += !!(t->flags & INCISE_TICK_CONTACT);
	extremes_check(run->row, !fault,
		       "%s: tick at %lld ns: %s: %d, force " V3 " after " V3
		       ", depth %a, v %a, phase %d, tool %d, flags %#x",
		       run->ground->name, (long long)t_ns, fault, rc, V3_OF(t->command_N),
		       V3_OF(was.command_N), t->depth_mm, t->velocity_mm_s, t->phase,
		       t->tool, t->flags);
}

void fed_run_step(struct fed_run *run, int64_t dt_ns)
{
	bool ends = run->t_ns > 0 && dt_ns > INT64_MAX - run->t_ns;

	fed_run_tick(run, ends ? INT64_MAX : run->t_ns + dt_ns);
}

void fed_run_above(const struct fed_run *run, double height_mm, double p[3])
{
	for (int i = 0; i < 3; i++)
		p[i] = run->top.point_mm[i] +
		       (height_mm == 0 ? height_mm : height_mm * run->top.normal[i]);
}

void fed_run_hold(struct fed_run *run, const double end_mm[3], const double attitude[4],
		  int ticks)
{
	double axis[3], p[3];

	for (int i = 0; i < ticks; i++) {
		v3_copy(p, end_mm);
		v3_rotate(axis, attitude, (const double[3]){0, 0, 1});
		if (run->tick.tool == INCISE_TOOL_HANDLE)
			v3_add(p, p, -GROUND_HANDLE_MM, axis);
		if (i % POSE_TICKS == 0)
			fed_run_feed(run, run->t_ns, p, attitude);
		fed_run_step(run, MS);
	}
}

void fed_run_move(struct fed_run *run, double from_mm, double to_mm, int ticks, int stay,
		  const double attitude[4])
{
	double p[3];

	for (int k = 0; k < ticks; k += POSE_TICKS) {
		int left = ticks - k;

		fed_run_above(run, from_mm + (to_mm - from_mm) * k / ticks, p);
		fed_run_hold(run, p, attitude, left < POSE_TICKS ? left : POSE_TICKS);
	}
	fed_run_above(run, to_mm, p);
	fed_run_hold(run, p, attitude, stay);
}
