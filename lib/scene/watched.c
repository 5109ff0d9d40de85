// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan whose force the kernel renders: a tick reads the kernel's results, and computes nothing. A
 * plan that feeds gives it the poses, too.
 *
 *   tracker ── stage pose ──▶ set-point page ──▶ incise_stepper.ko
 *      tick ◀── stage kernel ── status page ◀──┘
 */
#include <errno.h>
#include <math.h>
#include <incise/plan_file.h>
#include <incise/stepper_plan.h>
#include "../base/vector.h"
#include "plan.h"

/* A deadman that has not run out is kept off by so many signs of life. */
#define LIVES 4

static int take_axes(struct incise_plan *plan, struct incise_rig *rig,
		     struct incise_error *err)
{
	struct incise_stepper_rendered rendered;
	const struct incise_axis *first = &plan->axes.axis[0];
	double deadman_s = HUGE_VAL;

	incise_axes_take(&plan->axes, rig);
	if (!plan->axes.n)
		return incise_error_set(err, ENODEV, "the rig has no actuator");
	if (incise_stepper_rendered(first->stepper, &rendered) == -EOPNOTSUPP)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: it cannot run plans; use a stepper of the kernel module",
			first->info.name);
	for (int i = 0; i < plan->axes.n; i++)
		deadman_s = fmin(deadman_s, plan->axes.axis[i].info.deadman_s);
	plan->kernel.life_ns = (int64_t)(deadman_s * INCISE_NS_PER_S / LIVES);
	return 0;
}

static int give_pose(struct incise_plan *plan, bool tube,
		     const struct incise_tracker_sample *sample, int64_t now_ns)
{
	const struct incise_stepper_pose_given given = {
		.sample = sample,
		.tool = plan->wanted,
		.tube = tube,
		.fade = plan->fading,
	};
	int rc = incise_stepper_pose(plan->axes.axis[0].stepper, &given);

	if (!rc && !tube) {
		plan->kernel.fed_ns = now_ns;
		plan->kernel.fade_told = plan->fading;
	}
	return rc;
}

/* Without poses, and to fade at once. A fault is found by the look that follows. */
static void send_life(struct incise_plan *plan, int64_t now_ns)
{
	if (!plan->kernel.follow) {
		plan->kernel.follow = true;
		for (int i = 1; i < plan->axes.n; i++)
			plan->kernel.follow &=
				!incise_stepper_follow_plan(plan->axes.axis[i].stepper);
	}
	if (!plan->kernel.fed_ns ||
	    now_ns - plan->kernel.fed_ns >= plan->kernel.life_ns ||
	    plan->kernel.fade_told != plan->fading)
		give_pose(plan, false, NULL, now_ns);
}

static INCISE_REALTIME bool has_faded(const struct incise_plan *plan)
{
	enum incise_stepper_plan_state state = plan->kernel.last_seen.state;

	/* A plan that only watches leaves it to the feeder. */
	return !plan->kernel.feeds ||
	       (state != INCISE_STEPPER_PLAN_RISE && state != INCISE_STEPPER_PLAN_FELT &&
		v3_length(plan->last_N) == 0);
}

/* The tip, from the end of the held tool; the end of a tube with its own station does not give it. */
static void find_tip(const struct incise_plan *plan, struct incise_tick *tick)
{
	double axis[3];

	v3_copy(tick->position_mm, tick->tool_mm);
	if (tick->tool != INCISE_TOOL_HANDLE)
		return;
	v3_rotate(axis, tick->quaternion, plan->scene->tool.axis);
	v3_add(tick->position_mm, tick->tool_mm, -plan->scene->tool.handle_mm, axis);
}

static void take_watched(struct incise_plan *plan,
			 const struct incise_stepper_rendered *from,
			 struct incise_tick *tick)
{
	tick->flags |= from->flags;
	tick->phase = from->phase;
	tick->tool = plan->held = from->held;
	for (int i = 0; i < 4; i++)
		tick->quaternion[i] = from->quaternion[i];
	v3_copy(tick->tool_mm, from->tool_mm);
	v3_copy(tick->proxy_mm, from->proxy_mm);
	v3_copy(tick->normal, from->normal);
	v3_copy(tick->command_N, from->command_N);
	tick->depth_mm = from->depth_mm;
	tick->velocity_mm_s = from->speed_mm_s;
	find_tip(plan, tick);
}

static INCISE_REALTIME int find_rendered(struct incise_plan *plan,
					 struct incise_tick *tick)
{
	struct incise_stepper_rendered rendered;
	int rc;

	if (plan->kernel.feeds)
		send_life(plan, tick->t_ns);
	rc = incise_stepper_rendered(plan->axes.axis[0].stepper, &rendered);
	/* While the kernel writes: the last reading. */
	if (rc == -EAGAIN)
		rc = plan->kernel.seen ? 0 : -EIO;
	else if (!rc)
		plan->kernel.last_seen = rendered;
	if (rc)
		return rc;
	plan->kernel.seen = true;
	take_watched(plan, &plan->kernel.last_seen, tick);
	v3_copy(plan->last_N, tick->command_N);
	for (int i = 0; i < plan->axes.n; i++)
		tick->actuated_N[i] = plan->kernel.last_seen.along_N[i];
	incise_axes_rest(&plan->axes, tick->command_N, tick);
	return incise_axes_watch(&plan->axes, tick);
}

static INCISE_REALTIME void take_watched_pose(struct incise_plan *plan, bool tube,
					      const struct incise_tracker_sample *sample,
					      int64_t now_ns)
{
	give_pose(plan, tube, sample, now_ns);
}

static void keep_stages(struct incise_plan *plan, bool feeds)
{
	const struct incise_stage pose = plan->stage[0];

	plan->n_stages = 0;
	if (feeds)
		plan->stage[plan->n_stages++] = pose;
	plan->stage[plan->n_stages++] =
		(struct incise_stage){.name = "kernel", .run = find_rendered};
	plan->ops.take_pose = take_watched_pose;
	plan->ops.faded = has_faded;
	plan->kernel.runs = true;
	plan->kernel.feeds = feeds;
}

int incise_plan_watch(struct incise_plan *plan, struct incise_rig *rig,
		      struct incise_error *err)
{
	int rc = take_axes(plan, rig, err);

	if (!rc)
		keep_stages(plan, false);
	return rc;
}

int incise_plan_feed_kernel(struct incise_plan *plan, struct incise_rig *rig,
			    struct incise_error *err)
{
	struct incise_stepper *steppers[INCISE_RIG_AXES_MAX];
	struct incise_plan_file *file;
	const void *bytes;
	size_t size;
	int rc = take_axes(plan, rig, err);

	if (rc)
		return rc;
	file = incise_plan_file_new(plan, err);
	if (!file)
		return -errno;
	for (int i = 0; i < plan->axes.n; i++)
		steppers[i] = plan->axes.axis[i].stepper;
	bytes = incise_plan_file_bytes(file, &size);
	rc = incise_stepper_load_plan(steppers, plan->axes.n, bytes, size, err);
	incise_plan_file_free(file);
	if (!rc)
		keep_stages(plan, true);
	return rc;
}

void incise_plan_rendered(const struct incise_plan *plan,
			  struct incise_stepper_rendered *rendered)
{
	*rendered = plan->kernel.last_seen;
}
