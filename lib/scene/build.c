// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a scene and a rig to a plan that can tick.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "../model/model.h"
#include "plan.h"

/* Without a rig this tracker sends the poses: a magnetic one of 120 Hz. */
static const struct incise_tracker_info fed_tracker = {
	.name = "fed",
	.rate_hz = 120,
	.latency_ns = 4200000,
};

/* Where the rig's plane lies. */
struct plan_place {
	double point_mm[3], normal[3];
};

static const struct plan_place floor_place = {.normal = {0, 0, 1}};

static const struct incise_host_hold no_host = {.ticks = 1};

/* On a mesh the direction to the surface is rounding where the tool is shallow: so is the tilt. */
static bool fits_integers(const struct incise_scene *scene)
{
	const struct incise_scene_model *cut = &scene->cut[INCISE_CUT];
	bool tilts = false;

	for (int i = 0; i < cut->n_inputs; i++)
		tilts |= cut->input[i] == INCISE_INPUT_TILT;
	return !tilts || !scene->surface || !scene->surface->mesh;
}

/* The model in the scene's arithmetic. */
static int take_model(struct incise_plan *plan, struct incise_error *err)
{
	const struct incise_scene *scene = plan->scene;
	const struct incise_scene_model *cut = scene->cut;
	struct incise_error why = {0};

	for (int i = 0; i < INCISE_CUTTING_PHASES; i++)
		if (cut[i].compiled && (!scene->fixed || i != INCISE_CUT))
			return incise_error_set(
				err, EINVAL,
				"%s: its model is compiled and cannot run in double; use "
				"its .fis file",
				scene->path);
	if (scene->fixed && (cut[INCISE_PUNCTURE].path || cut[INCISE_WITHDRAW].path))
		return incise_error_set(
			err, ENOTSUP,
			"%s: model.puncture and model.withdraw have no form in integers; "
			"set arithmetic to \"double\"",
			scene->path);
	if (scene->fixed && !fits_integers(scene))
		return incise_error_set(
			err, ENOTSUP,
			"%s: its model has the input tilt_deg, whose error on a mesh is "
			"not bounded in integers; set arithmetic to \"double\"",
			scene->path);
	plan->fixed = cut[INCISE_CUT].compiled;
	plan->model = cut[INCISE_CUT].model;
	if (!plan->model || !scene->fixed)
		return 0;
	plan->fixed = plan->own_fixed = incise_fixed_compile(plan->model, NULL, &why);
	if (!plan->fixed)
		return incise_error_set(err, why.code, "%s: its model: %s", scene->path,
					why.text);
	return 0;
}

/*
 * @tracker: the tracker of the fed poses; with a rig, the rig's from here on, and @place as
 * well.
 */
static int take_rig(struct incise_plan *plan, struct incise_rig *rig,
		    struct incise_tracker_info *tracker, struct plan_place place,
		    struct incise_error *err)
{
	if (rig) {
		plan->poses.tracker = incise_rig_tracker(rig);
		if (!plan->poses.tracker)
			return incise_error_set(
				err, ENODEV,
				"%s: the rig has no tracker; name one in rig.conf",
				plan->scene->path);
		incise_tracker_info(plan->poses.tracker, tracker);
		incise_rig_surface(rig, place.point_mm, place.normal);
		incise_axes_take(&plan->axes, rig);
		plan->stylus = incise_rig_stylus(rig);
		plan->off = plan->stylus ? INCISE_HAPTIC_OUTSIDE : INCISE_HAPTIC_ON;
	}
	plan->surface = plan->scene->surface;
	if (!plan->surface)
		plan->surface = plan->own_surface =
			incise_surface_new_plane(place.point_mm, place.normal, err);
	return plan->surface ? 0 : -errno;
}

/* From here on @tracker is one station, with a part of the rate. */
static void take_stations(struct incise_plan *plan, struct incise_tracker_info *tracker)
{
	plan->poses.scalpel_station = tracker->scalpel_station;
	plan->poses.tube_station = tracker->tube_station;
	tracker->rate_hz = incise_tracker_station_hz(tracker);
	tracker->stations = 1;
}

static void take_tissue(struct incise_plan *plan)
{
	const struct incise_scene *scene = plan->scene;

	plan->gain = plan->hold.gain > 0 ? plan->hold.gain : scene->tissue.gain;
	plan->texture = scene->texture;
	for (int i = 0; i < incise_n_tissue_forces; i++) {
		struct incise_acting_force *own = &plan->acting[i];
		const double *number = scene->tissue.force[i];

		own->force = &incise_tissue_forces[i];
		for (int k = 0; k < INCISE_FORCE_NUMBERS; k++)
			own->number[k] = (k ? 1 : plan->gain) * number[k];
		if (!(number[own->force->acts] > 0))
			own->number[0] = 0;
	}
}

/* Whether anything resists insertion, and the reason why nothing is inserted. */
static void find_insertion(struct incise_plan *plan)
{
	size_t size = sizeof(plan->no_tool), n;

	n = (size_t)snprintf(plan->no_tool, size, "no insertion:");
	for (int i = 0, k = 0; i < incise_n_tissue_forces && n < size; i++) {
		const struct incise_tissue_force *force = &incise_tissue_forces[i];

		if (force->phases != 1U << INCISE_PHASE_INSERTION)
			continue;
		plan->inserts |= plan->acting[i].number[0] > 0;
		n += (size_t)snprintf(plan->no_tool + n, size - n, "%s tissue.%s",
				      k++ ? " and" : "", force->number[0].key);
	}
	if (n < size)
		snprintf(plan->no_tool + n, size - n, " are 0");
}

/* Whether a force of the scene may give back more than it took: see T(stage_work). */
static bool gives_back(const struct incise_plan *plan)
{
	const struct incise_scene *scene = plan->scene;

	return plan->inserts || plan->average_ticks > 1 || plan->surface->mesh ||
	       plan->stability.damping_N_s_mm > 0 || scene->membrane.thickness_mm > 0 ||
	       scene->cut[INCISE_PUNCTURE].path || scene->cut[INCISE_WITHDRAW].path ||
	       (scene->cut[INCISE_CUT].path &&
		(!scene->tissue.dissipates || scene->cut[INCISE_CUT].n_inputs > 2));
}

static void set_tool(struct incise_plan *plan)
{
	struct incise_touch top;

	find_insertion(plan);
	plan->held = INCISE_TOOL_BLADE;
	/* Without insertion there is only the blade. */
	plan->wanted = plan->inserts ? INCISE_TOOL_AUTO : INCISE_TOOL_BLADE;
	incise_surface_top(plan->surface, &top);
	v3_copy(plan->up, top.normal);
	incise_proxy_init(&plan->proxy, plan->surface, plan->scene->tissue.leave_mm);
	/* The average of a constant normal differs from it by rounding only. */
	plan->average_ticks = incise_surface_kind(plan->surface) == INCISE_SURFACE_PLANE
				      ? 1
				      : plan->scene->effects.average_ticks;
	plan->accounts = gives_back(plan);
}

static int check_membrane(const struct incise_plan *plan, struct incise_error *err)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;
	struct incise_proxy proxy;

	if (!(membrane->thickness_mm > 0))
		return 0;
	incise_proxy_init(&proxy, plan->surface, 0);
	incise_proxy_move(&proxy, membrane->point_mm);
	if (!proxy.touching)
		return incise_error_set(
			err, EINVAL,
			"%s: membrane.point_mm is outside the tissue; place it below "
			"the surface",
			plan->scene->path);
	if (!(v3_dot(membrane->normal, proxy.touch.normal) > 0))
		return incise_error_set(
			err, EINVAL,
			"%s: membrane.normal points into the tissue; reverse it",
			plan->scene->path);
	return 0;
}

static bool keeps(const struct incise_plan *plan, const char *stage)
{
	for (int i = 0; i < plan->n_stages; i++)
		if (!strcmp(plan->stage[i].name, stage))
			return true;
	return false;
}

/* Allocate the parts that only some stages need, for those that are kept. */
static int equip(struct incise_plan *plan, struct incise_error *err)
{
	bool tool = keeps(plan, "tool"), normal = keeps(plan, "normal");
	bool cuts = keeps(plan, "incision");
	struct incise_double_state *state = &plan->doubles.state;

	if (!plan->poses.tracker)
		plan->poses.fed = calloc(INCISE_PLAN_POSES, sizeof(*plan->poses.fed));
	if (tool)
		state->ends = calloc(1, sizeof(*state->ends));
	if (normal)
		state->average = calloc(1, sizeof(*state->average));
	if (cuts)
		plan->incision = incise_incision_new(plan->scene, NULL);
	if ((!plan->poses.tracker && !plan->poses.fed) || (tool && !state->ends) ||
	    (normal && !state->average) || (cuts && !plan->incision))
		return incise_error_set(err, ENOMEM, "no memory for a plan");
	if (cuts)
		state->incision = incise_incision_of(plan->incision);
	return 0;
}

/* The scene asks no more of a haptic device than it gives, and nothing is scaled silently. */
static int check_haptic(const struct incise_plan *plan,
			const struct incise_haptic_info *haptic, struct incise_error *err)
{
	if (!haptic)
		return 0;
	if (!(haptic->mass_kg > 0) || !(haptic->peak_N > 0))
		return incise_error_set(
			err, EDOM,
			"%s: the %s of %s is not known; set haptic_setup.%s in rig.conf",
			plan->scene->path, haptic->mass_kg > 0 ? "largest force" : "mass",
			haptic->name, haptic->mass_kg > 0 ? "peak_N" : "mass_kg");
	if (plan->scene->limits.force_N <= haptic->peak_N)
		return 0;
	return incise_error_set(err, EDOM,
				"%s: limits.force_N is %g N, but %s gives at most %g N; "
				"set it to that or less",
				plan->scene->path, plan->scene->limits.force_N,
				haptic->name, haptic->peak_N);
}

/* A pose that is used for the last time is its latency and a period old. */
static int check_age(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker, struct incise_error *err)
{
	double rate_hz = tracker->rate_hz / plan->hold.ticks;
	double least_ms = (double)tracker->latency_ns * 1e-6 + 1e3 / rate_hz;

	if (plan->scene->limits.pose_age_ms >= least_ms)
		return 0;
	if (plan->hold.ticks > 1)
		return incise_error_set(
			err, EDOM,
			"%s: limits.pose_age_ms: a host's poses are up to %.4g ms old "
			"with this host_period_s, and after %g ms there is no force; "
			"set it to %.1f or more, or host_period_s to less",
			plan->scene->path, least_ms, plan->scene->limits.pose_age_ms,
			ceil(least_ms * 10) / 10);
	return incise_error_set(
		err, EDOM,
		"%s: limits.pose_age_ms: poses of a tracker of %g Hz with a latency of "
		"%g ms can be older than %g ms, and then there is no force; set it to "
		"%.1f or more",
		plan->scene->path, rate_hz, (double)tracker->latency_ns * 1e-6,
		plan->scene->limits.pose_age_ms, ceil(least_ms * 10) / 10);
}

static struct incise_plan *new_plan(const struct incise_scene *scene,
				    struct incise_rig *rig,
				    struct incise_tracker_info tracker,
				    const struct plan_place *place,
				    struct incise_host_hold *hold,
				    struct incise_error *err)
{
	struct incise_plan *plan = calloc(1, sizeof(*plan));
	int rc;

	if (!plan)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a plan");
	plan->scene = scene;
	plan->hold = *hold;
	rc = take_rig(plan, rig, &tracker, *place, err);
	take_stations(plan, &tracker);
	if (!rc)
		rc = check_haptic(plan, tracker.haptic, err);
	if (!rc)
		rc = check_age(plan, &tracker, err);
	if (!rc)
		rc = check_membrane(plan, err);
	if (!rc)
		rc = take_model(plan, err);
	if (!rc) {
		take_tissue(plan);
		incise_predict_init(&plan->predict, &tracker, 0);
		rc = incise_plan_survey(plan, &tracker, err);
	}
	if (!rc) {
		set_tool(plan);
		incise_plan_choose(plan);
		rc = equip(plan, err);
	}
	if (!rc) {
		incise_plan_set_numbers(plan);
		incise_double_plan_begin(&plan->doubles.plan, &plan->doubles.state);
		plan->ops = incise_double_ops;
	}
	if (!rc)
		rc = incise_plan_check_rest(plan, &tracker, err);
	if (!rc && scene->fixed) {
		plan->integers = incise_integers_new(plan, err);
		plan->ops = incise_fixed_ops;
		rc = plan->integers ? 0 : -errno;
	}
	if (rc) {
		*hold = plan->hold;
		incise_plan_free(plan);
		errno = -rc;
		return NULL;
	}
	return plan;
}

struct incise_plan *incise_plan_new(const struct incise_scene *scene,
				    struct incise_rig *rig, struct incise_error *err)
{
	struct incise_host_hold hold = no_host;

	return new_plan(scene, rig, fed_tracker, &floor_place, &hold, err);
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
	struct incise_host_hold hold = no_host;
	struct plan_place place;

	if (!(tracker->rate_hz > 0) || !isfinite(tracker->rate_hz) ||
	    tracker->latency_ns < 0)
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"a tracker of %g Hz and %g ms: expected a rate above 0 and a "
			"latency of at least 0",
			tracker->rate_hz, (double)tracker->latency_ns * 1e-6);
	v3_copy(place.point_mm, point_mm);
	if (!v3_finite(point_mm) || !v3_unit(place.normal, normal, 0))
		return INCISE_ERROR_NULL(err, EINVAL,
					 "the tissue's plane has no point or no normal");
	return new_plan(scene, NULL, *tracker, &place, &hold, err);
}

struct incise_plan *incise_plan_new_held(const struct incise_scene *scene,
					 const struct incise_tracker_info *tracker,
					 struct incise_host_hold *hold,
					 struct incise_error *err)
{
	struct incise_plan *plan =
		new_plan(scene, NULL, *tracker, &floor_place, hold, err);

	if (plan || !hold->fit || !(hold->gain > 0))
		return plan;
	plan = new_plan(scene, NULL, *tracker, &floor_place, hold, err);
	if (plan && err)
		*err = (struct incise_error){0};
	return plan;
}
