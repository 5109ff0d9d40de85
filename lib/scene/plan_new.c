// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan as it is made: what it takes of the scene and of the rig, and what only some stages
 * need.
 *
 * A part of one noun: tests/unit/scene/plan.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "plan.h"

/* Without a rig poses are as of this tracker: a magnetic one of 120 Hz. */
static const struct incise_tracker_info fed_tracker = {
	.name = "fed",
	.rate_hz = 120,
	.latency_ns = 4200000,
};

/* Where the rig's plane lies. */
struct place {
	double point_mm[3], normal[3];
};

static const struct place floor_place = {.normal = {0, 0, 1}};

/* The model in the scene's arithmetic. */
static int take_model(struct incise_plan *plan, struct incise_error *err)
{
	const struct incise_scene *scene = plan->scene;
	struct incise_error why = {0};

	if (scene->compiled && !scene->fixed)
		return incise_error_set(
			err, EINVAL,
			"%s: its model is compiled: it cannot run in double; use the "
			".fis it was made of",
			scene->path);
	plan->fixed = scene->compiled;
	if (!scene->model)
		return 0;
	if (!scene->fixed) {
		plan->model = scene->model;
		return 0;
	}
	plan->fixed = plan->own_fixed = incise_fixed_compile(scene->model, NULL, &why);
	if (!plan->fixed)
		return incise_error_set(err, why.code, "%s: its model: %s", scene->path,
					why.text);
	return 0;
}

/*
 * @tracker: that of the poses that are fed, or, with a rig, the rig's from here on, and
 * @place as well.
 */
static int take_rig(struct incise_plan *plan, struct incise_rig *rig,
		    struct incise_tracker_info *tracker, struct place place,
		    struct incise_error *err)
{
	if (rig) {
		plan->tracker = incise_rig_tracker(rig);
		plan->stepper = incise_rig_stepper(rig);
		if (!plan->tracker)
			return incise_error_set(
				err, ENODEV,
				"%s: the rig has no tracker: name one in rig.conf",
				plan->scene->path);
		incise_tracker_info(plan->tracker, tracker);
		incise_rig_surface(rig, place.point_mm, place.normal);
	}
	v3_copy(plan->axis, place.normal);
	if (plan->stepper)
		incise_stepper_info(plan->stepper, &plan->actuator);
	plan->surface = plan->scene->surface;
	if (!plan->surface)
		plan->surface = plan->own_surface =
			incise_surface_new_plane(place.point_mm, plan->axis, err);
	return plan->surface ? 0 : -errno;
}

static void take_tissue(struct incise_plan *plan)
{
	const struct incise_scene *scene = plan->scene;

	plan->gain = scene->tissue.gain;
	plan->reaction_N_mm = plan->gain * scene->tissue.reaction_N_mm;
	plan->plane_N_mm = plan->gain * scene->tissue.plane_N_mm;
	plan->damping_N_s_mm = plan->gain * scene->tissue.damping_N_s_mm;
	plan->insertion_N_mm = plan->gain * scene->tissue.insertion_N_mm;
	plan->spread_N_mm = plan->gain * scene->tissue.spread_N_mm;
}

/*
 * What the tissue can have stored at most, N mm: of a spring that pushes with the largest
 * force F²/(2K), of a model all of its support at that force.
 */
static double reserve(const struct incise_plan *plan)
{
	const double springs[] = {plan->reaction_N_mm, plan->plane_N_mm,
				  plan->insertion_N_mm, plan->spread_N_mm};
	double force_N = plan->scene->limits.force_N, most = 0;

	for (size_t i = 0; i < sizeof(springs) / sizeof(*springs); i++)
		if (springs[i] > 0)
			most = fmax(most, force_N * force_N / (2 * springs[i]));
	if (plan->fixed)
		most = fmax(most, force_N * plan->fixed->input[0].max / INCISE_FIXED_ONE);
	else if (plan->model)
		most = fmax(most, force_N * incise_model_input(plan->model, 0)->max);
	return fmax(most, 0);
}

static void set_guard(struct incise_plan *plan)
{
	const struct incise_haptic_device *device = &plan->stability.device;
	/* Damping that acts d ticks late is itself stable below this, in m/T. */
	double late = 2 * sin(M_PI / (4.0 * device->delay_ticks + 2));

	incise_guard_init(plan->guard, device->mass_kg, device->period_s,
			  plan->scene->effects.guard ? reserve(plan) : 0);
	if (!plan->scene->effects.guard)
		return;
	plan->guard->cap_N_s_mm *= fmin(1, late);
	/*
	 * What the guard adds must not make a wall hum that did not; half of what is spare,
	 * as the guard's own share is half of what is stable.
	 */
	plan->guard->cap_N_s_mm =
		incise_plan_spare_damping(plan, 2 * plan->guard->cap_N_s_mm) / 2;
	plan->stability.guard_N_s_mm = plan->guard->cap_N_s_mm;
}

static void set_limits(struct incise_plan *plan)
{
	const struct incise_scene *scene = plan->scene;

	plan->pose_age_ns = (int64_t)(scene->limits.pose_age_ms * 1e6);
	plan->start = (struct incise_start){
		.small_N = scene->limits.start_N,
		.ramp_s = scene->limits.ramp_ms * 1e-3,
		.fade_s = scene->limits.fade_ms * 1e-3,
	};
	plan->limit = (struct incise_limit){
		.force_N = scene->limits.force_N,
		.slew_N = scene->limits.slew_N_s / scene->rate_hz,
	};
}

static void set_tool(struct incise_plan *plan)
{
	struct incise_touch top;

	v3_copy(plan->instrument.axis, plan->scene->tool.axis);
	v3_copy(plan->instrument.side, plan->scene->tool.side);
	plan->instrument.handle_mm = plan->scene->tool.handle_mm;
	plan->instrument.held = INCISE_TOOL_BLADE;
	plan->inserts = plan->insertion_N_mm > 0 || plan->spread_N_mm > 0;
	/* Without insertion there is only the blade. */
	if (!plan->inserts)
		plan->instrument.wanted = INCISE_TOOL_BLADE;
	incise_surface_top(plan->surface, &top);
	v3_copy(plan->up, top.normal);
	incise_proxy_init(&plan->proxy, plan->surface, plan->scene->tissue.leave_mm);
	/* The average of what never changes is a rounding beside it. */
	plan->average_ticks = incise_surface_kind(plan->surface) == INCISE_SURFACE_PLANE
				      ? 1
				      : plan->scene->effects.average_ticks;
}

static bool keeps(const struct incise_plan *plan, const char *stage)
{
	for (int i = 0; i < plan->n_stages; i++)
		if (!strcmp(plan->stage[i].name, stage))
			return true;
	return false;
}

/* What only some stages need, for those that are kept. */
static int equip(struct incise_plan *plan, const struct incise_tracker_info *tracker,
		 struct incise_error *err)
{
	bool handle = keeps(plan, "tool"), average = keeps(plan, "normal"),
	     guard = keeps(plan, "guard");

	if (!plan->tracker)
		plan->fed = calloc(INCISE_PLAN_POSES, sizeof(*plan->fed));
	if (handle)
		plan->handle = calloc(1, sizeof(*plan->handle));
	if (average)
		plan->average = calloc(1, sizeof(*plan->average));
	if (guard)
		plan->guard = calloc(1, sizeof(*plan->guard));
	if ((!plan->tracker && !plan->fed) || (handle && !plan->handle) ||
	    (average && !plan->average) || (guard && !plan->guard))
		return incise_error_set(err, ENOMEM, "no memory for a plan");
	if (handle)
		incise_predict_init(plan->handle, tracker, 0);
	if (average)
		incise_average_init(plan->average, plan->average_ticks);
	if (guard)
		set_guard(plan);
	return 0;
}

/* A pose that is used for the last time is its latency and a period old. */
static int check_age(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker, struct incise_error *err)
{
	double least_ms = (double)tracker->latency_ns * 1e-6 + 1e3 / tracker->rate_hz;

	if (plan->scene->limits.pose_age_ms >= least_ms)
		return 0;
	return incise_error_set(
		err, EDOM,
		"%s: limits.pose_age_ms: no pose of a tracker of %g Hz that is %g ms late is "
		"always younger than %g ms: there would be no force; set it to %.1f or more",
		plan->scene->path, tracker->rate_hz, (double)tracker->latency_ns * 1e-6,
		plan->scene->limits.pose_age_ms, ceil(least_ms * 10) / 10);
}

static struct incise_plan *new_plan(const struct incise_scene *scene,
				    struct incise_rig *rig,
				    struct incise_tracker_info tracker,
				    const struct place *place, struct incise_error *err)
{
	struct incise_plan *plan = calloc(1, sizeof(*plan));
	int rc;

	if (!plan) {
		incise_error_set(err, ENOMEM, "no memory for a plan");
		return NULL;
	}
	plan->scene = scene;
	rc = take_rig(plan, rig, &tracker, *place, err);
	if (!rc)
		rc = check_age(plan, &tracker, err);
	if (!rc)
		rc = take_model(plan, err);
	if (!rc) {
		take_tissue(plan);
		incise_predict_init(&plan->predict, &tracker, 0);
		rc = incise_plan_check(plan, &tracker, err);
	}
	if (!rc) {
		set_tool(plan);
		set_limits(plan);
		incise_plan_choose(plan);
		rc = equip(plan, &tracker, err);
	}
	if (rc) {
		incise_plan_free(plan);
		errno = -rc;
		return NULL;
	}
	return plan;
}

struct incise_plan *incise_plan_new(const struct incise_scene *scene,
				    struct incise_rig *rig, struct incise_error *err)
{
	return new_plan(scene, rig, fed_tracker, &floor_place, err);
}

struct incise_plan *incise_plan_new_fed(const struct incise_scene *scene,
					const struct incise_tracker_info *tracker,
					struct incise_error *err)
{
	return incise_plan_new_fed_on(scene, tracker, floor_place.point_mm,
				      floor_place.normal, err);
}

struct incise_plan *incise_plan_new_fed_on(const struct incise_scene *scene,
					   const struct incise_tracker_info *tracker,
					   const double point_mm[3],
					   const double normal[3],
					   struct incise_error *err)
{
	struct place place;

	if (!(tracker->rate_hz > 0) || !isfinite(tracker->rate_hz) ||
	    tracker->latency_ns < 0) {
		incise_error_set(err, EINVAL,
				 "a tracker of %g Hz and %g ms: expected a rate above 0 "
				 "and no negative latency",
				 tracker->rate_hz, (double)tracker->latency_ns * 1e-6);
		errno = EINVAL;
		return NULL;
	}
	v3_copy(place.point_mm, point_mm);
	if (!v3_finite(point_mm) || !v3_unit(place.normal, normal, 0)) {
		incise_error_set(err, EINVAL,
				 "the tissue's plane has no place or no normal");
		errno = EINVAL;
		return NULL;
	}
	return new_plan(scene, NULL, *tracker, &place, err);
}

void incise_plan_free(struct incise_plan *plan)
{
	if (!plan)
		return;
	incise_fixed_free(plan->own_fixed);
	incise_surface_free(plan->own_surface);
	free(plan->fed);
	free(plan->handle);
	free(plan->average);
	free(plan->guard);
	free(plan);
}
