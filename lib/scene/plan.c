// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The plan of a scene: an array of stages, each a few lines, run in order at each tick.
 * A stage that the scene or the rig does not need is not in the array.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "../base/monotonic.h"
#include "../base/vector.h"
#include "plan.h"

int incise_plan_feed(struct incise_plan *plan,
		     const struct incise_tracker_sample *samples, int n)
{
	int taken = 0;

	if (plan->tracker || n < 0)
		return -EINVAL;
	while (taken < n && plan->n_fed < INCISE_PLAN_POSES)
		plan->fed[plan->n_fed++] = samples[taken++];
	return taken;
}

int incise_plan_set_tip(struct incise_plan *plan, const double tip_mm[3])
{
	if (!v3_finite(tip_mm) || v3_length(tip_mm) > 1e6)
		return -EINVAL;
	v3_copy(plan->tip_mm, tip_mm);
	return 0;
}

int incise_plan_set_tool(struct incise_plan *plan, enum incise_tool tool)
{
	if ((unsigned int)tool > INCISE_TOOL_TUBE)
		return -EINVAL;
	if (plan->inserts)
		plan->instrument.wanted = tool;
	return 0;
}

void incise_plan_fade(struct incise_plan *plan, bool fading)
{
	plan->fading = fading;
}

bool incise_plan_faded(const struct incise_plan *plan)
{
	/* A gain of 0 asks for nothing; the slew may still be on its way there. */
	return plan->fading && !(plan->start.gain > 0) &&
	       v3_length(plan->limit.last_N) == 0;
}

int64_t incise_plan_fade_ns(const struct incise_plan *plan)
{
	double slew_s = plan->scene->limits.force_N / plan->scene->limits.slew_N_s;

	return (int64_t)((plan->start.fade_s + slew_s) * INCISE_NS_PER_S);
}

void incise_plan_release(struct incise_plan *plan)
{
	/* If this fails, the actuator's own deadman does it. */
	if (plan->stepper)
		incise_stepper_set(plan->stepper, 0);
}

const char *incise_plan_fault(const struct incise_plan *plan)
{
	unsigned int faults = plan->actuator_faults;

	if (!plan->fault)
		return NULL;
	if (faults)
		return incise_stepper_fault_text(
			(enum incise_stepper_fault)(faults & -faults));
	if (plan->actuator_off)
		return "the actuator has no power: enable it";
	return strerror(-plan->fault);
}

int incise_plan_cause(const struct incise_plan *plan, char *text, size_t size)
{
	const char *fault = incise_plan_fault(plan);
	int length = 0;

	/* Only of an actuator that has one: else a tracker's failure would go under. */
	if (plan->fault && plan->actuator_faults)
		length = incise_stepper_cause(plan->stepper, text, size);
	else if (plan->fault && !plan->actuator_off && plan->tracker)
		length = incise_tracker_cause(plan->tracker, text, size);
	/* It may have been cleared since, by someone else. */
	return length > 0 ? length : snprintf(text, size, "%s", fault ? fault : "");
}

/* Take the force away, and keep why. */
static int fail(struct incise_plan *plan, struct incise_tick *tick, int rc)
{
	plan->fault = rc;
	incise_limit_zero(&plan->limit);
	memset(tick->command_N, 0, sizeof(tick->command_N));
	tick->actuated_N = 0;
	tick->flags |= INCISE_TICK_FAULT;
	incise_plan_release(plan);
	return rc;
}

/* Inlined into both, so that the one without times does not pay for them. */
static inline __attribute__((always_inline)) int run_stages(struct incise_plan *plan,
							    int64_t t_ns,
							    struct incise_tick *tick,
							    int64_t *stage_ns)
{
	*tick = (struct incise_tick){.t_ns = t_ns, .tool = plan->instrument.held};
	if (plan->fault)
		return fail(plan, tick, plan->fault);
	for (int i = 0; i < plan->n_stages; i++) {
		const struct incise_stage *stage = &plan->stage[i];
		int64_t begin = stage_ns ? incise_monotonic_ns() : 0;
		int rc = 0;

		if (stage->always || !(tick->flags & INCISE_TICK_STALE))
			rc = stage->run(plan, tick);
		if (stage_ns)
			stage_ns[i] = incise_monotonic_ns() - begin;
		if (rc)
			return fail(plan, tick, rc);
	}
	return 0;
}

int incise_plan_tick(struct incise_plan *plan, int64_t t_ns, struct incise_tick *tick)
{
	return run_stages(plan, t_ns, tick, NULL);
}

int incise_plan_tick_timed(struct incise_plan *plan, int64_t t_ns,
			   struct incise_tick *tick, int64_t *stage_ns)
{
	/* A stage that a fault kept from running took no time. */
	memset(stage_ns, 0, INCISE_PLAN_STAGES_MAX * sizeof(*stage_ns));
	return run_stages(plan, t_ns, tick, stage_ns);
}
