// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The plan of a scene: an array of stages, each a few lines, run in order at each tick.
 * A stage that the scene or the rig does not need is not in the array.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include "../base/vector.h"
#include "../tissue/limit.h"
#include "../tissue/predict.h"
#include "scene.h"

#define STAGES_MAX 8

/* Poses taken at one tick; more than a tracker sends in a period, even after a stall. */
#define POSES 32

struct stage {
	const char *name;
	/* Returns 0, or a negative errno of a device. */
	int (*run)(struct incise_plan *plan, struct incise_tick *tick);
};

struct incise_plan {
	struct stage stage[STAGES_MAX + 1];
	int n_stages;
	struct incise_tracker *tracker;
	struct incise_stepper *stepper; /* or NULL */
	struct incise_predict predict;
	int64_t pose_age_ns;
	double point_mm[3], normal[3];
	struct incise_model *model; /* one of these */
	struct incise_fixed *fixed;
	double reaction_N; /* along the normal */
	struct incise_limit limit;
	double spring_N_mm;
	double handle_mm; /* where the handle was when last asked */
	int fault;	  /* negative errno of the device that failed, or 0 */
};

static int pose(struct incise_plan *plan, struct incise_tick *tick)
{
	struct incise_tracker_sample samples[POSES];
	int n = incise_tracker_read(plan->tracker, samples, POSES);

	for (int i = 0; i < n; i++) {
		/* A stamp from the future would keep all later poses out. */
		if (samples[i].t_ns > tick->t_ns)
			samples[i].t_ns = tick->t_ns;
		incise_predict_add(&plan->predict, &samples[i]);
	}
	return n < 0 ? n : 0;
}

static int predict(struct incise_plan *plan, struct incise_tick *tick)
{
	double velocity_mm_s[3], attitude[4];

	if (incise_predict_age(&plan->predict, tick->t_ns) > plan->pose_age_ns) {
		tick->flags |= INCISE_TICK_STALE;
		return 0;
	}
	incise_predict_at(&plan->predict, tick->t_ns, tick->position_mm, velocity_mm_s,
			  attitude);
	tick->velocity_mm_s = v3_length(velocity_mm_s);
	return 0;
}

/* The surface is a plane: depth is the distance of the tip behind it. */
static int contact(struct incise_plan *plan, struct incise_tick *tick)
{
	double above = 0;

	for (int i = 0; i < 3; i++)
		above += (tick->position_mm[i] - plan->point_mm[i]) * plan->normal[i];
	if (above < 0 && !(tick->flags & INCISE_TICK_STALE)) {
		tick->flags |= INCISE_TICK_CONTACT;
		tick->depth_mm = -above;
	}
	return 0;
}

/* Paper 1, eq. (3), as the magnitude of paper 2's reaction force; tissue does not pull. */
static int reaction(struct incise_plan *plan, struct incise_tick *tick)
{
	double x[] = {tick->depth_mm, tick->velocity_mm_s};
	unsigned int flags = 0;

	plan->reaction_N = 0;
	if (!(tick->flags & INCISE_TICK_CONTACT))
		return 0;
	if (plan->model) {
		plan->reaction_N = incise_model_eval(plan->model, x, &flags);
	} else {
		for (int i = 0; i < 2; i++)
			if (x[i] * INCISE_FIXED_ONE < plan->fixed->input[i].min ||
			    x[i] * INCISE_FIXED_ONE > plan->fixed->input[i].max)
				flags = INCISE_MODEL_EXTRAPOLATED;
		plan->reaction_N = incise_fixed_eval_double(plan->fixed, x);
	}
	if (flags)
		tick->flags |= INCISE_TICK_EXTRAPOLATED;
	plan->reaction_N = fmax(plan->reaction_N, 0);
	return 0;
}

static int limit(struct incise_plan *plan, struct incise_tick *tick)
{
	for (int i = 0; i < 3; i++)
		tick->command_N[i] = plan->reaction_N * plan->normal[i];
	if (incise_limit_apply(&plan->limit, tick->command_N))
		tick->flags |= INCISE_TICK_LIMITED;
	return 0;
}

/*
 * The actuator renders a force through its spring: the nut goes where the spring would
 * push with that force on the handle where it was at the last tick.
 */
static int actuate(struct incise_plan *plan, struct incise_tick *tick)
{
	struct incise_stepper_status status;
	int rc = incise_stepper_status(plan->stepper, &status);

	if (rc)
		return rc;
	tick->rendered_N = isfinite(status.force_N) ? status.force_N : 0;
	if (isfinite(status.handle_mm))
		plan->handle_mm = status.handle_mm;
	return incise_stepper_set(plan->stepper,
				  plan->handle_mm +
					  v3_dot(plan->limit.last_N, plan->normal) /
						  plan->spring_N_mm);
}

static void add_stage(struct incise_plan *plan, const char *name,
		      int (*run)(struct incise_plan *, struct incise_tick *))
{
	plan->stage[plan->n_stages++] = (struct stage){name, run};
}

struct incise_plan *incise_plan_new(const struct incise_scene *scene,
				    struct incise_rig *rig, struct incise_error *err)
{
	struct incise_plan *plan = calloc(1, sizeof(*plan));
	struct incise_tracker_info tracker;
	struct incise_stepper_info stepper;
	int rc = 0;

	if (!plan) {
		incise_error_set(err, ENOMEM, "no memory for a plan");
		return NULL;
	}
	plan->tracker = incise_rig_tracker(rig);
	plan->stepper = incise_rig_stepper(rig);
	if (!plan->tracker) {
		rc = incise_error_set(err, ENODEV,
				      "%s: the rig has no tracker: name one in rig.conf",
				      scene->path);
		goto out;
	}
	if (scene->compiled && !scene->fixed) {
		rc = incise_error_set(
			err, EINVAL,
			"%s: its model is compiled: it cannot run in double; use the "
			".fis it was made of",
			scene->path);
	} else if (scene->compiled) {
		plan->fixed = incise_fixed_copy(scene->compiled);
		if (!plan->fixed)
			rc = incise_error_set(err, ENOMEM, "no memory for a plan");
	} else if (scene->fixed) {
		plan->fixed = incise_fixed_compile(scene->model, NULL, err);
		rc = plan->fixed ? 0 : -errno;
	} else {
		plan->model = incise_model_copy(scene->model);
		if (!plan->model)
			rc = incise_error_set(err, ENOMEM, "no memory for a plan");
	}
	if (rc)
		goto out;
	incise_tracker_info(plan->tracker, &tracker);
	incise_predict_init(&plan->predict, &tracker);
	plan->pose_age_ns = (int64_t)(scene->pose_age_ms * 1e6);
	incise_rig_surface(rig, plan->point_mm, plan->normal);
	if (scene->own_surface) {
		memcpy(plan->point_mm, scene->point_mm, sizeof(plan->point_mm));
		memcpy(plan->normal, scene->normal, sizeof(plan->normal));
	}
	plan->limit = (struct incise_limit){
		.force_N = scene->force_N,
		.slew_N = scene->slew_N_s / scene->rate_hz,
	};
	add_stage(plan, "pose", pose);
	add_stage(plan, "predict", predict);
	add_stage(plan, "contact", contact);
	add_stage(plan, "reaction", reaction);
	add_stage(plan, "limit", limit);
	if (plan->stepper) {
		incise_stepper_info(plan->stepper, &stepper);
		plan->spring_N_mm = stepper.spring_N_mm;
		add_stage(plan, "actuate", actuate);
	}
out:
	if (rc) {
		incise_plan_free(plan);
		errno = -rc;
		return NULL;
	}
	return plan;
}

void incise_plan_free(struct incise_plan *plan)
{
	if (!plan)
		return;
	incise_model_free(plan->model);
	incise_fixed_free(plan->fixed);
	free(plan);
}

const char *incise_plan_stage(const struct incise_plan *plan, int index)
{
	return index >= 0 && index < plan->n_stages ? plan->stage[index].name : NULL;
}

void incise_plan_release(struct incise_plan *plan)
{
	/* If this fails, the actuator's own deadman does it. */
	if (plan->stepper)
		incise_stepper_set(plan->stepper, 0);
}

/* Take the force away, and keep why. */
static int fail(struct incise_plan *plan, struct incise_tick *tick, int rc)
{
	plan->fault = rc;
	incise_limit_zero(&plan->limit);
	memset(tick->command_N, 0, sizeof(tick->command_N));
	tick->flags |= INCISE_TICK_FAULT;
	incise_plan_release(plan);
	return rc;
}

int incise_plan_tick(struct incise_plan *plan, int64_t t_ns, struct incise_tick *tick)
{
	*tick = (struct incise_tick){.t_ns = t_ns};
	if (plan->fault)
		return fail(plan, tick, plan->fault);
	for (int i = 0; i < plan->n_stages; i++) {
		int rc = plan->stage[i].run(plan, tick);

		if (rc)
			return fail(plan, tick, rc);
	}
	return 0;
}
