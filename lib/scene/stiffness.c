// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The numbers of a scene's stability on its device, which go with the gain: its largest stiffness and damping, for
 * people and for the account of work; delay and lateness.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include "../base/vector.h"
#include "../control/pose_loop.h"
#include "../model/model.h"
#include "../model/slope.h"
#include "plan.h"

/*
 * The unloading is steeper than any slope of the model, so that the force can follow it: by as
 * much that the force may rise with the speed on the work that a cut has taken. With a texture it is also as steep as the
 * model is by the texture's largest factor.
 */
#define STEEPER 1.25

/* The lower end of the support of an input of a phase's model, and the upper one. */
static void find_input_range(const struct incise_plan *plan,
			     enum incise_cutting_phase phase, int i, double ends[2])
{
	const struct incise_variable *in;

	if (plan->fixed) {
		ends[0] = plan->fixed->input[i].min / (double)INCISE_FIXED_ONE;
		ends[1] = plan->fixed->input[i].max / (double)INCISE_FIXED_ONE;
		return;
	}
	in = &incise_model_info(plan->scene->cut[phase].model)->input[i];
	ends[0] = in->min;
	ends[1] = in->max;
}

static int input_of(const struct incise_plan *plan, enum incise_cutting_phase phase,
		    enum incise_model_input kind)
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];

	for (int i = 0; i < cut->n_inputs; i++)
		if (cut->input[i] == kind)
			return i;
	return -1;
}

bool incise_plan_kind_range(const struct incise_plan *plan, enum incise_model_input kind,
			    double ends[2])
{
	bool any = false;

	ends[0] = INFINITY;
	ends[1] = -INFINITY;
	for (int phase = 0; phase < INCISE_CUTTING_PHASES; phase++) {
		int i = input_of(plan, (enum incise_cutting_phase)phase, kind);
		double own[2];

		if (i < 0)
			continue;
		find_input_range(plan, (enum incise_cutting_phase)phase, i, own);
		ends[0] = fmin(ends[0], own[0]);
		ends[1] = fmax(ends[1], own[1]);
		any = true;
	}
	return any;
}

/* Part of the support over which the slope at its end is taken; least stiffness. */
#define EDGE 0.05
#define LEAST_N_mm 1e-3

/* Places of each other input at which that slope is looked at. */
#define PLACES 5

/*
 * The steepest slope by depth at the end of its support: at no speed, and wherever the other inputs
 * are. @x: all but the depth, from input @i on, are set here.
 */
static double edge_slope(const struct incise_plan *plan, int i,
			 double x[INCISE_LOOP_INPUTS_MAX])
{
	const struct incise_scene_model *cut = &plan->scene->cut[INCISE_CUT];
	double ends[2], steepest = -INFINITY, deep_N;

	if (i == cut->n_inputs) {
		int depth = input_of(plan, INCISE_CUT, INCISE_INPUT_DEPTH);
		double edge_mm;

		find_input_range(plan, INCISE_CUT, depth, ends);
		edge_mm = EDGE * ends[1];
		x[depth] = ends[1];
		deep_N = incise_plan_model_force(plan, INCISE_CUT, x);
		x[depth] = ends[1] - edge_mm;
		return (deep_N - incise_plan_model_force(plan, INCISE_CUT, x)) / edge_mm;
	}
	x[i] = 0;
	if (cut->input[i] == INCISE_INPUT_DEPTH || cut->input[i] == INCISE_INPUT_SPEED)
		return edge_slope(plan, i + 1, x);
	find_input_range(plan, INCISE_CUT, i, ends);
	for (int k = 0; k < PLACES; k++) {
		x[i] = ends[0] + (ends[1] - ends[0]) * k / (PLACES - 1);
		steepest = fmax(steepest, edge_slope(plan, i + 1, x));
	}
	return steepest;
}

/* The largest force of a phase at a depth, times @sign, wherever the other inputs are. */
static double largest_N(const struct incise_plan *plan, enum incise_cutting_phase phase,
			double depth_mm, double sign, int i,
			double x[INCISE_LOOP_INPUTS_MAX])
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];
	double ends[2], largest = -INFINITY;

	if (i == cut->n_inputs)
		return sign * incise_plan_model_force(plan, phase, x);
	find_input_range(plan, phase, i, ends);
	if (cut->input[i] == INCISE_INPUT_DEPTH)
		ends[0] = ends[1] = depth_mm;
	for (int k = 0; k < (ends[1] > ends[0] ? PLACES : 1); k++) {
		x[i] = ends[0] + (ends[1] - ends[0]) * k / (PLACES - 1);
		largest = fmax(largest, largest_N(plan, phase, depth_mm, sign, i + 1, x));
	}
	return largest;
}

/* The slope by which the force may rise from the puncture's force to the cut's. */
static double opening_slope(const struct incise_plan *plan)
{
	double x[INCISE_LOOP_INPUTS_MAX] = {0}, rise_N = 0;

	for (int k = 0; k < PLACES && plan->scene->cut[INCISE_PUNCTURE].model; k++) {
		double depth_mm = plan->scene->tissue.cut_from_mm +
				  INCISE_PUNCTURE_MM * k / (PLACES - 1);

		rise_N = fmax(rise_N, largest_N(plan, INCISE_CUT, depth_mm, 1, 0, x) +
					      largest_N(plan, INCISE_PUNCTURE, depth_mm,
							-1, 0, x));
	}
	return rise_N / INCISE_PUNCTURE_MM;
}

double incise_plan_texture_most(const struct incise_plan *plan)
{
	const struct incise_fixed_texture *texture = plan->texture;
	int most = 0;

	for (int i = 0; texture && i < INCISE_TEXTURE_KNOTS; i++)
		most = texture->knot[i] > most ? texture->knot[i] : most;
	return texture ? (1 + (double)most / INCISE_TEXTURE_ONE) * texture->factor_most /
				 INCISE_FIXED_ONE
		       : 1;
}

/* The stiffness with which a model's tissue unloads, and its slope beyond its support. */
static void set_tissue(struct incise_plan *plan)
{
	double own = plan->scene->tissue.force[0][INCISE_REACTION_UNLOADING];
	double steepest_N_mm = plan->gain * plan->steepest_N_mm;

	plan->beyond_N_mm = fmin(fmax(plan->gain * plan->edge_N_mm, 0), steepest_N_mm);
	/* Softer than the model, it could not follow it. */
	plan->unloading_N_mm =
		fmax(fmax(own > 0 ? own : STEEPER * steepest_N_mm, LEAST_N_mm),
		     incise_plan_texture_most(plan) * steepest_N_mm);
}

/* Take the slopes of a phase's model into the plan's, where they are larger. */
static void take_slopes(struct incise_plan *plan, enum incise_cutting_phase phase,
			const struct incise_slope *slopes)
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];
	struct incise_plan_stability *s = &plan->stability;
	double steepest_N_mm = 0;

	for (int i = 0; i < cut->n_inputs; i++) {
		double either = fmax(fabs(slopes[i].lowest), fabs(slopes[i].highest));
		double *to = &plan->input_slope[cut->input[i]];

		s->certified = s->certified && slopes[i].certified;
		*to = fmax(*to, plan->gain * either);
		/* A blade that goes deeper moves both; a force that pulls it back may rise either way. */
		if (cut->input[i] == INCISE_INPUT_DEPTH ||
		    cut->input[i] == INCISE_INPUT_DEEPEST)
			steepest_N_mm += phase == INCISE_WITHDRAW
						 ? either
						 : fmax(slopes[i].highest, 0);
	}
	plan->steepest_N_mm = fmax(plan->steepest_N_mm, steepest_N_mm);
}

/* The largest slopes of the models, by depth, by speed and by acceleration; its support, and the slope there. */
static int survey_model(struct incise_plan *plan)
{
	struct incise_plan_stability *s = &plan->stability;
	struct incise_slope slope[INCISE_LOOP_INPUTS_MAX];
	double x[INCISE_LOOP_INPUTS_MAX] = {0}, ends[2];

	find_input_range(plan, INCISE_CUT, input_of(plan, INCISE_CUT, INCISE_INPUT_DEPTH),
			 ends);
	plan->support_mm = ends[1];
	plan->dissipates = plan->scene->tissue.dissipates;
	plan->edge_N_mm = edge_slope(plan, 0, x);
	/* The search for the slopes takes longer than the test of a scene's stages. */
	if (plan->scene->unchecked) {
		plan->steepest_N_mm =
			plan->scene->tissue.force[0][INCISE_REACTION_UNLOADING] /
			plan->gain;
		return 0;
	}
	for (int i = 0; i < INCISE_CUTTING_PHASES; i++) {
		const struct incise_scene_model *cut = &plan->scene->cut[i];

		if (!cut->path)
			continue;
		if (!cut->model)
			incise_fixed_slopes(plan->fixed, slope);
		else if (incise_model_slopes(cut->model, slope))
			return -ENOMEM;
		take_slopes(plan, (enum incise_cutting_phase)i, slope);
	}
	/* Where a contact begins, the mean speed is the speed. */
	s->speed_slope_N_s_mm = plan->input_slope[INCISE_INPUT_SPEED] +
				plan->input_slope[INCISE_INPUT_MEAN_SPEED];
	s->acceleration_slope_N_s2_mm = plan->input_slope[INCISE_INPUT_ACCELERATION];
	plan->steepest_N_mm += opening_slope(plan);
	s->slope_N_mm = plan->gain * plan->steepest_N_mm;
	/* The search looked at single places. */
	if (plan->scene->cut[INCISE_PUNCTURE].model)
		s->certified = false;
	return 0;
}

/*
 * Set the delay of a force behind a pose: the scene's, or the tracker's latency and the period for which a pose is
 * used.
 */
static void set_delay(struct incise_plan *plan, const struct incise_tracker_info *tracker)
{
	struct incise_haptic_device *device = &plan->stability.device;
	double late_s = (double)tracker->latency_ns / INCISE_NS_PER_S +
			(tracker->rate_hz > 0 ? 1 / tracker->rate_hz : 0);
	double ticks = ceil(late_s / device->period_s - 1e-9);

	/* A haptic device says its own. */
	plan->stability.own_delay =
		plan->scene->device.delay_ticks >= 0 && !tracker->haptic;
	device->delay_ticks = plan->stability.own_delay ? plan->scene->device.delay_ticks
							: (int)fmin(ticks, INT_MAX);
}

/* The lateness of a haptic device in place of the scene's. */
static int set_own_lateness(struct incise_plan *plan,
			    const struct incise_haptic_info *info,
			    struct incise_error *err)
{
	struct incise_plan_stability *s = &plan->stability;
	double ticks = ceil((double)info->force_latency_ns /
				    (s->device.period_s * INCISE_NS_PER_S) -
			    1e-9);

	if (ticks > INCISE_POSE_LOOP_LATE_MAX)
		return incise_error_set(
			err, EDOM,
			"%s: %s: its force is %.0f ticks late: stability can be checked "
			"up to %d; lower rate_hz, or correct haptic_setup.force_latency_ms",
			plan->scene->path, info->name, ticks, INCISE_POSE_LOOP_LATE_MAX);
	s->late_ticks = (int)ticks;
	plan->early_s = fmax(0, ticks * s->device.period_s -
					(double)info->force_latency_ns * 1e-9);
	return 0;
}

/* Lateness of each actuator: the scene's, or rig.conf's for this actuator. */
static int set_lateness(struct incise_plan *plan, struct incise_error *err)
{
	struct incise_plan_stability *s = &plan->stability;

	s->late_ticks = plan->scene->device.late_ticks;
	s->n_axes = plan->axes.n;
	for (int i = 0; i < s->n_axes; i++) {
		const struct incise_stepper_info *info = &plan->axes.axis[i].info;
		double ticks = ceil(info->late_s / s->device.period_s - 1e-9);

		if (ticks > INCISE_POSE_LOOP_LATE_MAX)
			return incise_error_set(
				err, EDOM,
				"%s: %s: actuator.late_ms of rig.conf is %g, %.0f "
				"ticks: stability can be checked up to %d; correct it",
				plan->scene->path, info->name, info->late_s * 1e3, ticks,
				INCISE_POSE_LOOP_LATE_MAX);
		s->axis_late_ticks[i] = (int)fmax(plan->scene->device.late_ticks, ticks);
		s->late_ticks = (int)fmax(s->late_ticks, s->axis_late_ticks[i]);
	}
	return 0;
}

static double membrane_N_mm(const struct incise_plan *plan)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;

	return membrane->thickness_mm > 0
		       ? plan->gain * membrane->puncture_N / membrane->thickness_mm
		       : 0;
}

/*
 * Whether tissue and membrane push at once: behind a membrane the tissue's force stays as it was where the tool went
 * through its plane, as long as the skin is as far away there. Half a millimetre is let pass: a membrane of 5 mm in a
 * neck of 55 mm has a quarter.
 */
#define ASLANT_MM 0.5

/* Beyond the membrane's disc a tool may come some way aside. */
#define UPRIGHT_OF 0.95

static bool is_aslant(struct incise_plan *plan)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;
	double along[3], across[3], low_mm = INFINITY, high_mm = -INFINITY, least = 1;

	v3_any_across(along, membrane->normal);
	v3_cross(across, membrane->normal, along);
	for (int i = 0; i < 16; i++) {
		struct incise_touch touch;
		double at_mm[3], turn = M_PI / 8 * i;

		v3_add(at_mm, membrane->point_mm, membrane->radius_mm * cos(turn), along);
		v3_add(at_mm, at_mm, membrane->radius_mm * sin(turn), across);
		incise_surface_nearest(plan->surface, at_mm, &touch);
		low_mm = fmin(low_mm, touch.depth_mm);
		high_mm = fmax(high_mm, touch.depth_mm);
		least = fmin(least, v3_dot(touch.normal, membrane->normal));
	}
	plan->upright = UPRIGHT_OF * fmax(least, 0);
	return high_mm - low_mm > ASLANT_MM;
}

/*
 * The largest stiffness in any phase, and the largest damping. Springs along the normal and across it act along
 * different lines; a spring to a side acts along either.
 */
static void add_up(struct incise_plan *plan, double model_N_mm)
{
	struct incise_plan_stability *s = &plan->stability;
	double K = membrane_N_mm(plan);
	bool aslant = plan->scene->membrane.thickness_mm > 0 && is_aslant(plan);
	bool both = K > 0 && aslant;
	double all = 0;

	s->stiffness_N_mm = s->damping_N_s_mm = 0;
	for (int phase = 0; phase < 3; phase++) {
		double sum[INCISE_FORCE_KINDS] = {0};

		for (int i = 0; i < incise_n_tissue_forces; i++) {
			const struct incise_acting_force *own = &plan->acting[i];
			bool model = incise_plan_has_model(plan, own);

			if (own->force->phases >> phase & 1)
				sum[own->force->kind] +=
					model ? model_N_mm : own->number[0];
		}
		if (phase != INCISE_PHASE_FREE && both)
			sum[INCISE_SPRING_NORMAL] += K;
		else if (phase != INCISE_PHASE_FREE)
			sum[INCISE_SPRING_NORMAL] = fmax(sum[INCISE_SPRING_NORMAL], K);
		s->stiffness_N_mm =
			fmax(s->stiffness_N_mm,
			     fmax(sum[INCISE_SPRING_NORMAL], sum[INCISE_SPRING_ACROSS]) +
				     sum[INCISE_SPRING_SIDE]);
		s->damping_N_s_mm = fmax(s->damping_N_s_mm, sum[INCISE_DAMPER]);
		all = fmax(all, sum[INCISE_SPRING_NORMAL] + sum[INCISE_SPRING_ACROSS] +
					sum[INCISE_SPRING_SIDE]);
	}
	/* More, so that rounding does not make a potential's work 0. */
	plan->account_N_mm = fmin(1.25 * (all + K), 32767);
}

void incise_plan_set_gain(struct incise_plan *plan, double gain)
{
	double model_N_mm = 0;

	plan->gain = gain;
	for (int i = 0; i < incise_n_tissue_forces; i++)
		if (plan->acting[i].number[0] != 0)
			plan->acting[i].number[0] =
				gain * plan->scene->tissue.force[i][0];
	if (plan->model || plan->fixed) {
		set_tissue(plan);
		model_N_mm = plan->dissipates ? plan->unloading_N_mm
					      : gain * plan->steepest_N_mm;
		/* Not checked, it may be stiffer. */
		if (plan->scene->unchecked)
			model_N_mm = fmax(plan->unloading_N_mm, 1);
	}
	add_up(plan, model_N_mm);
}

int incise_plan_survey(struct incise_plan *plan,
		       const struct incise_tracker_info *tracker,
		       struct incise_error *err)
{
	struct incise_plan_stability *s = &plan->stability;
	const struct incise_scene *scene = plan->scene;
	const struct incise_haptic_info *haptic = tracker->haptic;

	s->device = (struct incise_haptic_device){
		.mass_kg = scene->device.mass_kg,
		.damping_N_s_mm = scene->device.damping_N_s_mm,
		.coulomb_N = scene->device.coulomb_N,
		.encoder_mm = scene->device.encoder_mm,
		.period_s = 1 / scene->rate_hz,
	};
	/* A haptic device says its own. */
	if (haptic) {
		s->device.mass_kg = haptic->mass_kg;
		s->device.damping_N_s_mm = haptic->damping_N_s_mm;
		s->device.coulomb_N = haptic->coulomb_N;
		s->device.encoder_mm = haptic->encoder_mm;
	}
	set_delay(plan, tracker);
	s->certified = true;
	if (set_lateness(plan, err) || (haptic && set_own_lateness(plan, haptic, err)))
		return -EDOM;
	if ((plan->model || plan->fixed) && survey_model(plan))
		return incise_error_set(err, ENOMEM, "no memory for a plan");
	incise_plan_set_gain(plan, plan->gain);
	s->support_mm = plan->support_mm;
	s->beyond_N_mm = plan->beyond_N_mm;
	s->unloading_N_mm = plan->dissipates ? plan->unloading_N_mm : 0;
	if (scene->unchecked)
		return 0;
	if (s->acceleration_slope_N_s2_mm > 0 && s->own_delay)
		return incise_error_set(
			err, EDOM,
			"%s: device.delay_ticks: with it no scene is known to be stable "
			"whose model has the input acceleration_mm_s2; remove "
			"delay_ticks",
			scene->path);
	return 0;
}

_Static_assert(INCISE_PLAN_INPUTS_MAX == INCISE_LOOP_INPUTS_MAX, "the same");

void incise_plan_model(const struct incise_plan *plan, enum incise_cutting_phase phase,
		       struct incise_plan_model *model)
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];

	*model = (struct incise_plan_model){.n_inputs = cut->n_inputs};
	for (int i = 0; i < model->n_inputs; i++) {
		double ends[2];

		find_input_range(plan, phase, i, ends);
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
