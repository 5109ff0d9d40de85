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

	plan->gain = scene->tissue.gain;
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

/* A pose that is used for the last time is its latency and a period old. */
static int check_age(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker, struct incise_error *err)
{
	double least_ms = (double)tracker->latency_ns * 1e-6 + 1e3 / tracker->rate_hz;

	if (plan->scene->limits.pose_age_ms >= least_ms)
		return 0;
	return incise_error_set(
		err, EDOM,
		"%s: limits.pose_age_ms: poses of a tracker of %g Hz with a latency of "
		"%g ms can be older than %g ms, and then there is no force; set it to "
		"%.1f or more",
		plan->scene->path, tracker->rate_hz, (double)tracker->latency_ns * 1e-6,
		plan->scene->limits.pose_age_ms, ceil(least_ms * 10) / 10);
}

static struct incise_plan *new_plan(const struct incise_scene *scene,
				    struct incise_rig *rig,
				    struct incise_tracker_info tracker,
				    const struct plan_place *place,
				    struct incise_error *err)
{
	struct incise_plan *plan = calloc(1, sizeof(*plan));
	int rc;

	if (!plan) {
		incise_error_set(err, ENOMEM, "no memory for a plan");
		return NULL;
	}
	plan->scene = scene;
	rc = take_rig(plan, rig, &tracker, *place, err);
	take_stations(plan, &tracker);
	if (!rc)
		rc = check_age(plan, &tracker, err);
	if (!rc)
		rc = check_membrane(plan, err);
	if (!rc)
		rc = take_model(plan, err);
	if (!rc) {
		take_tissue(plan);
		incise_predict_init(&plan->predict, &tracker, 0);
		rc = incise_plan_check(plan, &tracker, err);
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
	struct plan_place place;

	if (!(tracker->rate_hz > 0) || !isfinite(tracker->rate_hz) ||
	    tracker->latency_ns < 0) {
		incise_error_set(err, EINVAL,
				 "a tracker of %g Hz and %g ms: expected a rate above "
				 "0 and a latency of at least 0",
				 tracker->rate_hz, (double)tracker->latency_ns * 1e-6);
		errno = EINVAL;
		return NULL;
	}
	v3_copy(place.point_mm, point_mm);
	if (!v3_finite(point_mm) || !v3_unit(place.normal, normal, 0)) {
		incise_error_set(err, EINVAL,
				 "the tissue's plane has no point or no normal");
		errno = EINVAL;
		return NULL;
	}
	return new_plan(scene, NULL, *tracker, &place, err);
}

void incise_plan_copy(struct incise_plan *copy, const struct incise_plan *plan,
		      double gain)
{
	*copy = *plan;
	copy->integers = NULL;
	copy->ops = incise_double_ops;
	incise_plan_set_gain(copy, gain);
	incise_plan_set_numbers(copy);
}

void incise_plan_take_over(struct incise_plan *plan, const struct incise_plan *before)
{
	/* Its state is only read. */
	struct incise_plan *from = (struct incise_plan *)(uintptr_t)before;
	struct incise_cut cut;

	*plan->ops.punctured(plan) = *before->ops.punctured(from);
	plan->ops.clear_cuts(plan);
	for (int i = 0; before->ops.cut(from, i, &cut); i++)
		plan->ops.add_cut(plan, &cut);
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
	if (plan->fixed)
		size += sizeof(*plan->fixed) + plan->fixed->size;
	for (int i = 0; i < INCISE_CUTTING_PHASES; i++)
		if (plan->scene->cut[i].model)
			size += sizeof(*plan->scene->cut[i].model);
	return size;
}

_Static_assert(INCISE_PLAN_INPUTS_MAX == INCISE_LOOP_INPUTS_MAX, "the same");

void incise_plan_model(const struct incise_plan *plan, enum incise_cutting_phase phase,
		       struct incise_plan_model *model)
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];

	*model = (struct incise_plan_model){.n_inputs = cut->n_inputs};
	for (int i = 0; i < model->n_inputs; i++) {
		double ends[2];

		incise_plan_input_range(plan, phase, i, ends);
		model->input[i] = incise_model_input_kinds[cut->input[i]].name;
		model->min[i] = ends[0];
		model->max[i] = ends[1];
	}
	if (!model->n_inputs)
		return;
	model->evaluator = plan->fixed
				   ? incise_fixed_arithmetic_name(plan->fixed->arithmetic)
				   : "double";
	model->memory_bytes = plan->fixed ? sizeof(*plan->fixed) + plan->fixed->size
					  : sizeof(*plan->model);
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
