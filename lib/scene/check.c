// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Whether a scene is stable on its device, before its first tick: the largest stiffness
 * of the scene against the limit of the loop with the tracker's poses, or, where the scene
 * says how late its device answers, against the exact limit of a wall so late.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include "../model/slope.h"
#include "../control/pose_loop.h"
#include "plan.h"

/* The largest slopes of the model, by depth and by speed. */
static int survey_model(struct incise_plan *plan, double *stiffness_N_mm)
{
	struct incise_plan_stability *s = &plan->stability;
	struct incise_slope slope[2];

	if (plan->fixed && !plan->scene->model)
		incise_fixed_slopes(plan->fixed, slope);
	else if (incise_model_slopes(plan->scene->model, slope))
		return -ENOMEM;
	s->certified = slope[0].certified && slope[1].certified;
	s->speed_slope_N_s_mm =
		plan->gain * fmax(fabs(slope[1].lowest), fabs(slope[1].highest));
	*stiffness_N_mm = plan->gain * fmax(slope[0].highest, 0);
	return 0;
}

/*
 * Set the delay of a force behind a pose: that of the scene, or the tracker's: its latency
 * and the period for which a pose is used. The second is what the guard goes by.
 */
static void set_delay(struct incise_plan *plan, const struct incise_tracker_info *tracker)
{
	struct incise_haptic_device *device = &plan->stability.device;
	double late_s = (double)tracker->latency_ns / INCISE_NS_PER_S +
			(tracker->rate_hz > 0 ? 1 / tracker->rate_hz : 0);
	double ticks = ceil(late_s / device->period_s - 1e-9);

	plan->stability.own_delay = plan->scene->device.delay_ticks >= 0;
	device->delay_ticks = plan->stability.own_delay ? plan->scene->device.delay_ticks
							: (int)fmin(ticks, INT_MAX);
}

static double limit_N_mm(const struct incise_plan *plan, double damping_N_s_mm)
{
	struct incise_haptic_device device = plan->stability.device;

	if (plan->stability.own_delay)
		return incise_stability_limit(&device, damping_N_s_mm);
	return incise_pose_loop_limit(&device, &plan->predict, damping_N_s_mm);
}

static bool holds(const struct incise_plan *plan, double stiffness_N_mm,
		  double damping_N_s_mm)
{
	double most = limit_N_mm(plan, damping_N_s_mm);

	/* A limit of 0 is that of a loop which its damper alone makes unstable. */
	if (!(most > 0) && damping_N_s_mm > 0)
		return false;
	return stiffness_N_mm <= most;
}

static bool stable(const struct incise_plan *plan, double share)
{
	const struct incise_plan_stability *s = &plan->stability;

	return holds(plan, share * s->stiffness_N_mm, share * s->damping_N_s_mm);
}

double incise_plan_spare_damping(const struct incise_plan *plan, double most_N_s_mm)
{
	const struct incise_plan_stability *s = &plan->stability;
	double low = 0, high = most_N_s_mm;

	if (holds(plan, s->stiffness_N_mm, s->damping_N_s_mm + most_N_s_mm))
		return most_N_s_mm;
	/* To a hundredth of @most. */
	for (int i = 0; i < 7; i++) {
		double middle = (low + high) / 2;

		*(holds(plan, s->stiffness_N_mm, s->damping_N_s_mm + middle) ? &low
									     : &high) =
			middle;
	}
	return low;
}

/* The largest gain that is stable; damping goes with it, so that the limit moves. */
static double largest_gain(const struct incise_plan *plan)
{
	double low = 0, high = 1;

	if (!(plan->stability.damping_N_s_mm > 0))
		return plan->gain * plan->stability.limit_N_mm /
		       plan->stability.stiffness_N_mm;
	while (high - low > 1e-4) {
		double middle = (low + high) / 2;

		*(stable(plan, middle) ? &low : &high) = middle;
	}
	return low * plan->gain;
}

/* For a message: downwards, as what is named must be safe. */
static double three_digits_down(double gain)
{
	double unit;

	if (!(gain > 0))
		return 0;
	unit = pow(10, floor(log10(gain)) - 2);
	return floor(gain / unit) * unit;
}

/* Where the delay comes from, for a message. */
static void name_delay(const struct incise_plan_stability *s,
		       const struct incise_tracker_info *tracker, char name[64])
{
	if (s->own_delay)
		snprintf(name, 64, "that answers %d ticks late", s->device.delay_ticks);
	else
		snprintf(name, 64, "felt through a tracker of %g Hz and %g ms",
			 tracker->rate_hz, (double)tracker->latency_ns * 1e-6);
}

/*
 * The largest stiffness in any phase, and the largest damping. Springs along the normal and
 * across it act along different lines, one to a side along a line that may be either.
 */
static void add_up(struct incise_plan *plan, double model_N_mm)
{
	struct incise_plan_stability *s = &plan->stability;

	for (int phase = 0; phase < 3; phase++) {
		double sum[INCISE_FRICTION + 1] = {0};

		for (int i = 0; i < incise_n_tissue_forces; i++) {
			const struct incise_acting_force *own = &plan->acting[i];
			bool model = own->force->model && (plan->model || plan->fixed);

			if (own->force->phases >> phase & 1)
				sum[own->force->kind] +=
					model ? model_N_mm : own->number[0];
		}
		s->stiffness_N_mm =
			fmax(s->stiffness_N_mm,
			     fmax(sum[INCISE_SPRING_NORMAL], sum[INCISE_SPRING_ACROSS]) +
				     sum[INCISE_SPRING_SIDE]);
		s->damping_N_s_mm = fmax(s->damping_N_s_mm, sum[INCISE_DAMPER]);
	}
}

int incise_plan_check(struct incise_plan *plan, const struct incise_tracker_info *tracker,
		      struct incise_error *err)
{
	struct incise_plan_stability *s = &plan->stability;
	const struct incise_scene *scene = plan->scene;
	double model_N_mm = 0, gain;
	char delay[64], advice[64];

	s->device = (struct incise_haptic_device){
		.mass_kg = scene->device.mass_kg,
		.damping_N_s_mm = scene->device.damping_N_s_mm,
		.coulomb_N = scene->device.coulomb_N,
		.encoder_mm = scene->device.encoder_mm,
		.period_s = 1 / scene->rate_hz,
	};
	set_delay(plan, tracker);
	s->certified = true;
	if ((plan->model || plan->fixed) && survey_model(plan, &model_N_mm))
		return incise_error_set(err, ENOMEM, "no memory for a plan");
	add_up(plan, model_N_mm);
	s->limit_N_mm = limit_N_mm(plan, s->damping_N_s_mm);
	if (stable(plan, 1))
		return 0;
	name_delay(s, tracker, delay);
	gain = three_digits_down(largest_gain(plan));
	if (gain > 0)
		snprintf(advice, sizeof(advice), "set tissue.gain to at most %.3g", gain);
	else
		snprintf(advice, sizeof(advice),
			 "no gain is small enough: it needs damping");
	return incise_error_set(
		err, EDOM,
		"%s: not stable: its tissue has %.4g N/mm and %.4g N s/mm, a device of "
		"%g kg and %g N s/mm %s holds %.4g N/mm; %s, or describe the device",
		scene->path, s->stiffness_N_mm, s->damping_N_s_mm, s->device.mass_kg,
		s->device.damping_N_s_mm, delay, s->limit_N_mm, advice);
}
