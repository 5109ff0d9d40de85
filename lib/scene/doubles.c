// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan in double: its numbers, from the scene and the rig, and its ticks.
 */
#include <math.h>
#include "../base/monotonic.h"
#include "../base/vector.h"
#include "plan.h"

static void set_reaction(const struct incise_plan *plan,
			 struct incise_double_numbers *numbers)
{
	bool model = plan->model || plan->fixed, front = model && plan->dissipates;

	numbers->unloading = front ? plan->unloading_N_mm : 0;
	/* Without a model friction acts in an open cut, which only insertion needs. */
	if (!front && (model || !plan->inserts))
		numbers->friction = 0;
	if (!model)
		return;
	numbers->reaction = 0;
	numbers->gain = plan->gain;
	numbers->support = plan->support_mm;
	numbers->beyond = plan->beyond_N_mm;
}

static void set_membrane(const struct incise_plan *plan,
			 struct incise_double_membrane *to)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;

	if (!(membrane->thickness_mm > 0))
		return;
	v3_copy(to->point, membrane->point_mm);
	v3_copy(to->normal, membrane->normal);
	to->radius = membrane->radius_mm;
	to->thickness = membrane->thickness_mm;
	to->stiffness = plan->gain * membrane->puncture_N / membrane->thickness_mm;
	to->back_wall = membrane->back_wall_mm;
}

_Static_assert(INCISE_FIXED_INPUT_DEPTH == INCISE_INPUT_DEPTH + 1 &&
		       INCISE_FIXED_INPUT_SPEED == INCISE_INPUT_SPEED + 1 &&
		       INCISE_FIXED_INPUT_ACCELERATION == INCISE_INPUT_ACCELERATION + 1 &&
		       INCISE_FIXED_INPUT_TILT == INCISE_INPUT_TILT + 1 &&
		       INCISE_FIXED_INPUT_TIME == INCISE_INPUT_TIME + 1 &&
		       INCISE_FIXED_INPUT_MEAN_SPEED == INCISE_INPUT_MEAN_SPEED + 1 &&
		       INCISE_FIXED_INPUT_DEEPEST == INCISE_INPUT_DEEPEST + 1,
	       "the same, from 1");

static void set_model(const struct incise_plan *plan, struct incise_double_plan *to)
{
	const struct incise_scene_model *cut = plan->scene->cut;

	to->has_model = plan->model || plan->fixed;
	to->compiled = plan->fixed;
	to->texture = plan->texture;
	for (int i = 0; i < INCISE_CUTTING_PHASES; i++) {
		to->model[i] = i == INCISE_CUT ? plan->model : cut[i].model;
		to->inputs[i] = 0;
		for (int k = 0; k < cut[i].n_inputs; k++)
			to->inputs[i] |= (uint32_t)(cut[i].input[k] + 1) << 4 * k;
	}
	if (cut[INCISE_PUNCTURE].model)
		to->numbers.phases |= T_PUNCTURES;
	if (cut[INCISE_WITHDRAW].model)
		to->numbers.phases |= T_WITHDRAWS;
}

/* A haptic device starts more slowly. */
static double ramp_ms(const struct incise_plan *plan)
{
	double own_s = plan->stylus ? plan->stylus->setup.start_s : 0;

	return fmax(plan->scene->limits.ramp_ms, own_s * 1e3);
}

void incise_plan_set_numbers(struct incise_plan *plan)
{
	const struct incise_scene *scene = plan->scene;
	struct incise_double_plan *to = &plan->doubles.plan;
	struct incise_double_numbers *numbers = &to->numbers;
	const struct incise_double_numbers before = *numbers;

	*numbers = (struct incise_double_numbers){
		.pose_age_ns = (int64_t)(scene->limits.pose_age_ms * 1e6),
		.tick_ns = (int32_t)lrint(1e9 / scene->rate_hz),
		.handle = scene->tool.handle_mm,
		.inserts = plan->inserts,
		.tube = plan->inserts && plan->poses.tube_station,
		.leave = scene->tissue.leave_mm,
		.average_ticks = plan->average_ticks,
		.printed = scene->tissue.printed_orientation,
		/* Not 0 without springs. */
		.account = plan->accounts ? fmax(plan->account_N_mm, 1e-3) : 0,
		.upright = plan->upright,
		.incision = incise_scene_cuts(scene),
		.small = scene->limits.start_N,
		.ramp_ns = ramp_ms(plan) * 1e6,
		.fade_ns = scene->limits.fade_ms * 1e6,
		.force = scene->limits.force_N,
		.slew = scene->limits.slew_N_s / scene->rate_hz,
	};
	incise_predict_filter(&plan->predict, &numbers->filter);
	v3_copy(numbers->tip, before.tip);
	v3_copy(numbers->axis, scene->tool.axis);
	v3_copy(numbers->side, scene->tool.side);
	v3_copy(numbers->up, plan->up);
#define FORCE(...)
#define NUMBER(row, i, member, ...) \
	numbers->member = plan->acting[INCISE_FORCE_##row].number[i];
#define MORE(member)
#include "../tissue/forces.def"
	set_reaction(plan, numbers);
	/* Both numbers go with the gain: so far the tissue gives way before it tears, by depth; 1 J/m² is 1e-3 N/mm. */
	if (numbers->fracture > 0)
		numbers->gives *= 1e-3 / scene->tissue.force[INCISE_FORCE_FRACTURE][0];
	set_membrane(plan, &numbers->membrane);
	set_model(plan, to);
	to->proxy = &plan->proxy;
}

/* --- running ----------------------------------------------------------------------------- */

#include "../number/double_kind.h"
#define OWN(plan) (&(plan)->doubles)
#define STAGE in_double
#define D_LEAST 1e-300

static double n_from(double mm)
{
	return mm;
}

#define d_from n_from
#define n_to n_from
#define d_to n_from

static INCISE_REALTIME int set_tip(struct incise_plan *plan, const double tip_mm[3])
{
	v3_copy(plan->doubles.plan.numbers.tip, tip_mm);
	return 0;
}

#include "run.proto.c"
