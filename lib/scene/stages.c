// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The stages of devices: the tracker's poses, and the actuators or a haptic device.
 */
#include <errno.h>
#include "../base/vector.h"
#include "plan.h"

static bool is_tube(const struct incise_plan *plan, uint8_t station)
{
	return plan->poses.tube_station && station == plan->poses.tube_station;
}

/* Station 0 is not known: a tracker, or a program that feeds poses, with only one. */
static bool is_scalpel(const struct incise_plan *plan, uint8_t station)
{
	return !is_tube(plan, station) && (!plan->poses.scalpel_station || !station ||
					   station == plan->poses.scalpel_station);
}

/*
 * Whether a pose is used, by its flag. An unusable pose is left out as if it had not come,
 * so that the last one ages.
 */
static bool is_usable(struct incise_plan *plan,
		      const struct incise_tracker_sample *sample, int64_t now_ns)
{
	bool usable = incise_pose_count(&plan->poses.counts, sample->status);

	if (!usable && !plan->poses.none_usable)
		plan->poses.unusable_ns = now_ns;
	plan->poses.none_usable = !usable;
	if (is_tube(plan, sample->station)) {
		plan->poses.tube_unusable = !usable;
		return usable;
	}
	plan->poses.flag = sample->status;
	plan->poses.unusable = !usable;
	return usable;
}

static void take_stages(struct incise_plan *plan, struct incise_tracker_sample *samples,
			int n, struct incise_tick *tick)
{
	int64_t now_ns = tick->t_ns;

	for (int i = 0; i < n; i++) {
		bool tube = is_tube(plan, samples[i].station);

		if (!tube && !is_scalpel(plan, samples[i].station))
			continue;
		if (!is_usable(plan, &samples[i], now_ns))
			continue;
		/* A timestamp from the future would keep all later poses out. */
		if (samples[i].t_ns > now_ns)
			samples[i].t_ns = now_ns;
		plan->ops.take_pose(plan, tube, &samples[i], now_ns);
	}
	if (plan->poses.unusable)
		tick->flags |= INCISE_TICK_UNUSABLE;
}

/* A haptic device that is off takes no force: the plan fades its own, and lets it return. */
static INCISE_REALTIME void watch_stylus(struct incise_plan *plan, int64_t now_ns)
{
	enum incise_haptic_off off = incise_stylus_off(plan->stylus, now_ns);

	if (off == plan->off)
		return;
	plan->off = off;
	plan->ops.hold(plan);
}

int incise_stage_pose(struct incise_plan *plan, struct incise_tick *tick)
{
	struct incise_tracker_sample samples[INCISE_PLAN_POSES];
	int n = incise_tracker_read(plan->poses.tracker, samples, INCISE_PLAN_POSES);

	take_stages(plan, samples, n, tick);
	plan->poses.blind = n > 0 && plan->poses.none_usable &&
			    tick->t_ns - plan->poses.unusable_ns >= INCISE_PLAN_BLIND_NS;
	if (plan->poses.blind)
		return -ENODEV;
	if (plan->stylus)
		watch_stylus(plan, tick->t_ns);
	return n < 0 ? n : 0;
}

int incise_stage_fed(struct incise_plan *plan, struct incise_tick *tick)
{
	take_stages(plan, plan->poses.fed, plan->poses.n_fed, tick);
	plan->poses.n_fed = 0;
	return 0;
}

int incise_stage_actuate(struct incise_plan *plan, struct incise_tick *tick)
{
	return incise_axes_render(&plan->axes, plan->last_N, tick);
}

int incise_stage_push(struct incise_plan *plan, struct incise_tick *tick)
{
	v3_copy(tick->actuated_N, plan->last_N);
	v3_copy(tick->rendered_N, plan->last_N);
	return incise_stylus_push(plan->stylus, plan->last_N);
}
