// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The plan of a scene: an array of stages, each a few lines, that run in order at each tick.
 * A stage that the scene or the rig does not need is not in the array.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "../model/model.h"
#include "plan.h"

void incise_plan_take_over(struct incise_plan *plan, const struct incise_plan *before)
{
	/* Its state is only read. */
	struct incise_plan *from = (struct incise_plan *)(uintptr_t)before;
	struct incise_cut cut;

	*plan->ops.punctured(plan) = *before->ops.punctured(from);
	plan->ops.clear_cuts(plan);
	for (int i = 0; before->ops.cut(from, i, &cut); i++)
		plan->ops.add_cut(plan, &cut);
	if (plan->texture)
		plan->felt = before->felt;
}

void incise_plan_free(struct incise_plan *plan)
{
	if (!plan)
		return;
	incise_fixed_free(plan->own_fixed);
	incise_surface_free(plan->own_surface);
	free(plan->poses.fed);
	free(plan->doubles.state.ends);
	free(plan->doubles.state.average);
	incise_incision_free(plan->incision);
	free(plan->integers);
	free(plan);
}

int incise_plan_feed(struct incise_plan *plan,
		     const struct incise_tracker_sample *samples, int n)
{
	int taken = 0;

	if (plan->poses.tracker || n < 0)
		return -EINVAL;
	while (taken < n && plan->poses.n_fed < INCISE_PLAN_POSES)
		plan->poses.fed[plan->poses.n_fed++] = samples[taken++];
	return taken;
}

int incise_plan_set_tip(struct incise_plan *plan, const double tip_mm[3])
{
	if (!v3_finite(tip_mm) || v3_length(tip_mm) > 1e6)
		return -EINVAL;
	return plan->ops.set_tip(plan, tip_mm);
}

int incise_plan_set_tool(struct incise_plan *plan, enum incise_tool tool)
{
	if ((unsigned int)tool > INCISE_TOOL_TUBE)
		return -EINVAL;
	if (plan->inserts)
		plan->wanted = tool;
	plan->ops.hold(plan);
	return 0;
}

void incise_plan_fade(struct incise_plan *plan, bool fading)
{
	plan->fading = fading;
	plan->ops.hold(plan);
}

bool incise_plan_faded(const struct incise_plan *plan)
{
	return plan->fading && plan->ops.faded(plan);
}

int64_t incise_plan_fade_ns(const struct incise_plan *plan)
{
	double slew_s = plan->scene->limits.force_N / plan->scene->limits.slew_N_s;

	return (int64_t)((plan->scene->limits.fade_ms * 1e-3 + slew_s) * INCISE_NS_PER_S);
}

int incise_plan_release(struct incise_plan *plan)
{
	/* The first error remains the cause. */
	int rc = plan->kernel.runs && !plan->kernel.feeds
			 ? 0
			 : incise_axes_release(&plan->axes, plan->fault);
	const double none[3] = {0};
	int pushed = plan->stylus ? incise_stylus_push(plan->stylus, none) : 0;

	rc = rc ? rc : pushed;
	if (!plan->fault)
		plan->fault = rc;
	return rc;
}

const char *incise_plan_fault(const struct incise_plan *plan)
{
	const char *fault = incise_axes_fault(&plan->axes);

	if (!plan->fault)
		return NULL;
	return fault ? fault : strerror(-plan->fault);
}

void incise_plan_poses(const struct incise_plan *plan, struct incise_pose_counts *counts)
{
	*counts = plan->poses.counts;
}

enum incise_haptic_off incise_plan_off(const struct incise_plan *plan)
{
	return plan->off;
}

char incise_plan_pose_flag(const struct incise_plan *plan)
{
	return plan->poses.flag;
}

/* The tracker works, but gives no usable pose. */
static int blind_cause(const struct incise_plan *plan, char *text, size_t size)
{
	struct incise_tracker_info info;

	incise_tracker_info(plan->poses.tracker, &info);
	return snprintf(
		text, size,
		"%s sent no usable pose for %.0f s, the last with the flag '%c' (%s); "
		"see Tracker flags in rig.conf(5)",
		info.name, (double)INCISE_PLAN_BLIND_NS / INCISE_NS_PER_S,
		plan->poses.flag > ' ' && plan->poses.flag <= '~' ? plan->poses.flag
								  : '?',
		incise_pose_flag(plan->poses.flag));
}

int incise_plan_cause(const struct incise_plan *plan, char *text, size_t size)
{
	const char *fault = incise_plan_fault(plan);
	int length = 0;

	if (plan->fault && plan->poses.blind)
		return blind_cause(plan, text, size);
	/* Only of an actuator that has one: else a tracker's failure would go under. */
	if (plan->fault)
		length = incise_axes_cause(&plan->axes, plan->fault, text, size);
	if (plan->fault && length <= 0 && plan->poses.tracker)
		length = incise_tracker_cause(plan->poses.tracker, text, size);
	return length > 0 ? length : snprintf(text, size, "%s", fault ? fault : "");
}

int incise_plan_fail(struct incise_plan *plan, struct incise_tick *tick, int rc)
{
	plan->fault = rc;
	v3_copy(plan->last_N, (const double[3]){0, 0, 0});
	plan->ops.zero(plan);
	memset(tick->command_N, 0, sizeof(tick->command_N));
	memset(tick->actuated_N, 0, sizeof(tick->actuated_N));
	tick->unfelt_N = 0;
	tick->flags |= INCISE_TICK_FAULT;
	incise_plan_release(plan);
	return rc;
}

int incise_plan_tick(struct incise_plan *plan, int64_t t_ns, struct incise_tick *tick)
{
	return plan->ops.tick(plan, t_ns, tick, NULL);
}

int64_t incise_plan_run(struct incise_plan *plan,
			const struct incise_tracker_sample *poses, size_t n,
			int64_t start_ns, int64_t period_ns, struct incise_tick *ticks,
			size_t n_ticks)
{
	size_t next = 0;

	if (plan->poses.tracker || period_ns <= 0)
		return -EINVAL;
	for (size_t i = 1; i < n; i++)
		if (poses[i].t_ns < poses[i - 1].t_ns)
			return -EINVAL;
	for (size_t k = 0; k < n_ticks; k++) {
		int64_t t_ns = start_ns + (int64_t)k * period_ns;
		size_t first = next;

		while (next < n && poses[next].t_ns <= t_ns)
			next++;
		if (next - first > INCISE_PLAN_POSES)
			first = next - INCISE_PLAN_POSES;
		incise_plan_feed(plan, poses + first, (int)(next - first));
		if (incise_plan_tick(plan, t_ns, &ticks[k]))
			return (int64_t)k + 1;
	}
	return (int64_t)n_ticks;
}

int incise_plan_tick_timed(struct incise_plan *plan, int64_t t_ns,
			   struct incise_tick *tick, int64_t *stage_ns)
{
	/* A stage that a fault kept from running took no time. */
	memset(stage_ns, 0, INCISE_PLAN_STAGES_MAX * sizeof(*stage_ns));
	return plan->ops.tick(plan, t_ns, tick, stage_ns);
}

const char *incise_plan_stage(const struct incise_plan *plan, int index)
{
	return index >= 0 && index < plan->n_stages ? plan->stage[index].name : NULL;
}

const char *incise_plan_left_out(const struct incise_plan *plan, int index,
				 const char **why)
{
	if (index < 0 || index >= plan->n_left_out)
		return NULL;
	if (why)
		*why = plan->left_out[index].why;
	return plan->left_out[index].name;
}

size_t incise_plan_memory(const struct incise_plan *plan)
{
	size_t size = sizeof(*plan) + incise_surface_memory(plan->surface);

	size += plan->poses.fed ? INCISE_PLAN_POSES * sizeof(*plan->poses.fed) : 0;
	size += plan->doubles.state.ends ? sizeof(*plan->doubles.state.ends) : 0;
	size += plan->doubles.state.average ? sizeof(*plan->doubles.state.average) : 0;
	size += plan->incision ? incise_incision_memory(plan->incision) : 0;
	size += plan->integers ? sizeof(*plan->integers) : 0;
	size += plan->texture ? sizeof(*plan->texture) : 0;
	if (plan->fixed)
		size += sizeof(*plan->fixed) + plan->fixed->size;
	for (int i = 0; i < INCISE_CUTTING_PHASES; i++)
		if (plan->scene->cut[i].model)
			size += sizeof(*plan->scene->cut[i].model);
	return size;
}

/* In integers there is the model of the cut only. */
double incise_plan_model_force(const struct incise_plan *plan,
			       enum incise_cutting_phase phase, const double *x)
{
	const struct incise_model *model = plan->scene->cut[phase].model;

	if (plan->fixed)
		return incise_fixed_eval_double(plan->fixed, x);
	return model ? incise_model_eval(model, x, NULL) : 0;
}

void incise_plan_top(const struct incise_plan *plan, struct incise_touch *touch)
{
	incise_surface_top(plan->surface, touch);
}

const struct incise_surface *incise_plan_surface(const struct incise_plan *plan)
{
	return plan->surface;
}

void incise_plan_stability(const struct incise_plan *plan,
			   struct incise_plan_stability *stability)
{
	*stability = plan->stability;
}
