// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The stages between the tissue's force and the hand.
 */
#include <errno.h>
#include "../base/vector.h"
#include "stages.h"

/* In free air too: a debt of energy is paid there as well. */
int incise_stage_guard(struct incise_plan *plan, struct incise_tick *tick)
{
	const struct incise_predict *held = plan->instrument.held == INCISE_TOOL_HANDLE
						    ? plan->handle
						    : &plan->predict;

	/* A force did no work on a way that nobody went. */
	if (plan->leaps != held->leaps)
		incise_guard_leap(plan->guard);
	plan->leaps = held->leaps;
	if (incise_guard_apply(plan->guard, tick->tool_mm, plan->velocity_mm_s,
			       plan->force_N))
		tick->flags |= INCISE_TICK_GUARDED;
	return 0;
}

/* Without a fresh pose the last force stays, and fades. */
int incise_stage_start(struct incise_plan *plan, struct incise_tick *tick)
{
	/* Unsigned: two times may be farther apart than an int64_t holds. */
	uint64_t gone_ns = (uint64_t)tick->t_ns - (uint64_t)plan->last_ns;
	double dt_s = plan->last_ns && tick->t_ns > plan->last_ns
			      ? (double)gone_ns / INCISE_NS_PER_S
			      : 0;
	bool fresh = !(tick->flags & INCISE_TICK_STALE) && !plan->fading;
	double gain =
		incise_start_gain(&plan->start, v3_length(plan->force_N), fresh, dt_s);

	plan->last_ns = tick->t_ns;
	if (gain < 1)
		tick->flags |= INCISE_TICK_STARTING;
	for (int i = 0; i < 3; i++)
		tick->command_N[i] = gain * plan->force_N[i];
	return 0;
}

int incise_stage_limit(struct incise_plan *plan, struct incise_tick *tick)
{
	unsigned int held = incise_limit_apply(&plan->limit, tick->command_N);

	if (held & INCISE_LIMIT_FORCE)
		tick->flags |= INCISE_TICK_CLAMPED;
	if (held & INCISE_LIMIT_SLEW)
		tick->flags |= INCISE_TICK_SLEWED;
	if (held & INCISE_LIMIT_NOT_FINITE)
		tick->flags |= INCISE_TICK_NOT_FINITE;
	if (plan->guard)
		incise_guard_sent(plan->guard, tick->command_N);
	return 0;
}

/* An actuator that does not move any more: keep why. */
static int refused(struct incise_plan *plan, const struct incise_stepper_status *status,
		   int rc)
{
	plan->actuator_faults = status->faults & ~(unsigned int)INCISE_STEPPER_TRAVEL;
	plan->actuator_off = rc == -EIO && status->state == INCISE_STEPPER_DISABLED;
	return rc;
}

/*
 * Where the handle is: as the actuator measures it, else what the hand holds is the
 * handle, and the tracker's pose of it says where along the axis it is. Without a fresh
 * pose it is where it was; before the first one, where the spring is at rest.
 */
static void take_handle(struct incise_plan *plan, const struct incise_tick *tick,
			const struct incise_stepper_status *status)
{
	double mm = status->handle_mm;

	if (!plan->actuator.measures_handle) {
		if (!(tick->flags & INCISE_TICK_STALE))
			mm = v3_dot(tick->tool_mm, plan->axis) - plan->actuator.origin_mm;
		else if (!plan->handle_seen)
			mm = status->position_mm;
	}
	if (!isfinite(mm))
		return;
	plan->handle_mm = mm;
	plan->handle_seen |= !(tick->flags & INCISE_TICK_STALE);
}

static double rendered(const struct incise_plan *plan,
		       const struct incise_stepper_status *status)
{
	double force_N = status->force_N;

	if (!plan->actuator.measures_handle)
		force_N = plan->actuator.spring_N_mm *
			  (status->position_mm - plan->handle_mm);
	return isfinite(force_N) ? force_N : 0;
}

/*
 * The actuator renders a force through its spring: the nut goes where the spring would
 * push with that force on the handle where it was at the last tick. It has one axis; what
 * of the force is across it is not felt.
 */
int incise_stage_actuate(struct incise_plan *plan, struct incise_tick *tick)
{
	double along_N = v3_dot(plan->limit.last_N, plan->axis), target_mm, held_mm;
	struct incise_stepper_status status = {0};
	int rc = incise_stepper_status(plan->stepper, &status);

	if (rc)
		return refused(plan, &status, rc);
	tick->actuated_N = along_N;
	take_handle(plan, tick, &status);
	tick->rendered_N = rendered(plan, &status);
	target_mm = plan->handle_mm + along_N / plan->actuator.spring_N_mm;
	held_mm = fmax(0, fmin(plan->actuator.travel_mm, target_mm));
	/* Less than a step beyond is where its position is read to. */
	if (fabs(target_mm - held_mm) > plan->actuator.step_mm)
		tick->flags |= INCISE_TICK_TRAVEL;
	rc = incise_stepper_set(plan->stepper, held_mm);
	if (rc)
		incise_stepper_status(plan->stepper, &status);
	return rc ? refused(plan, &status, rc) : 0;
}
