// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The stages that add the tissue's forces; the formulas are in lib/tissue/effects.h.
 * While there is no contact none of them has a force to add.
 */
#include <math.h>
#include <incise/fixed.h>
#include "../base/vector.h"
#include "../tissue/effects.h"
#include "stages.h"

/* Distance from a cut within which an instrument goes in: half a handle's width. */
#define REACH_MM 5.0

static int32_t to_fixed(double x)
{
	return (int32_t)lrint(fmax(-32767, fmin(32767, x)) * INCISE_FIXED_ONE);
}

/* A spring in integers between two points; only their difference has to fit. */
static void add_fixed(double force[3], const struct incise_fixed_spring *spring,
		      const double p[3], const double p0[3], bool push)
{
	int32_t off[3], f[3] = {0};

	for (int i = 0; i < 3; i++)
		off[i] = to_fixed(p[i] - p0[i]);
	if (push)
		incise_fixed_spring_push(spring, off, f);
	else
		incise_fixed_spring_pull(spring, off, f);
	for (int i = 0; i < 3; i++)
		force[i] += (double)f[i] / INCISE_FIXED_ONE;
}

/* Paper 2, Fn = Kn d along the normal. */
int incise_stage_reaction(struct incise_plan *plan, struct incise_tick *tick)
{
	if (tick->phase == INCISE_PHASE_CUTTING)
		incise_effect_reaction(plan->force_N,
				       plan->reaction_N_mm * plan->depth_mm,
				       plan->normal);
	return 0;
}

int incise_stage_reaction_fixed(struct incise_plan *plan, struct incise_tick *tick)
{
	const double origin[3] = {0};
	struct incise_fixed_spring spring;
	double below[3] = {0};

	if (tick->phase != INCISE_PHASE_CUTTING)
		return 0;
	v3_add(below, below, -plan->depth_mm, plan->normal);
	if (!incise_fixed_spring_set(&spring, plan->reaction_N_mm, origin, plan->normal))
		add_fixed(plan->force_N, &spring, below, origin, true);
	return 0;
}

/* Paper 1, eq. (3), as the size of paper 2's Fn; tissue does not pull. */
static void add_fuzzy(struct incise_plan *plan, struct incise_tick *tick, double size_N,
		      bool outside)
{
	/* With no gain the model is asked only to keep the stage, not for a force. */
	if (outside && plan->gain > 0)
		tick->flags |= INCISE_TICK_EXTRAPOLATED;
	incise_effect_reaction(plan->force_N, fmax(plan->gain * size_N, 0), plan->normal);
}

int incise_stage_fuzzy(struct incise_plan *plan, struct incise_tick *tick)
{
	double x[] = {plan->depth_mm, tick->velocity_mm_s};
	unsigned int flags = 0;
	double size_N;

	if (tick->phase != INCISE_PHASE_CUTTING || !(plan->depth_mm > 0))
		return 0;
	size_N = incise_model_eval(plan->model, x, &flags);
	add_fuzzy(plan, tick, size_N, flags);
	return 0;
}

int incise_stage_fuzzy_fixed(struct incise_plan *plan, struct incise_tick *tick)
{
	double x[] = {plan->depth_mm, tick->velocity_mm_s};
	bool outside = false;

	if (tick->phase != INCISE_PHASE_CUTTING || !(plan->depth_mm > 0))
		return 0;
	for (int i = 0; i < 2; i++)
		outside |= x[i] * INCISE_FIXED_ONE < plan->fixed->input[i].min ||
			   x[i] * INCISE_FIXED_ONE > plan->fixed->input[i].max;
	add_fuzzy(plan, tick, incise_fixed_eval_double(plan->fixed, x), outside);
	return 0;
}

/* Paper 2, Fx: the blade stays in the plane of its cut. */
int incise_stage_plane(struct incise_plan *plan, struct incise_tick *tick)
{
	if (tick->phase == INCISE_PHASE_CUTTING)
		incise_effect_plane(plan->force_N, plan->plane_N_mm, tick->tool_mm,
				    plan->p0_mm, plan->incision.side);
	return 0;
}

int incise_stage_plane_fixed(struct incise_plan *plan, struct incise_tick *tick)
{
	const double origin[3] = {0};

	if (tick->phase != INCISE_PHASE_CUTTING)
		return 0;
	if (plan->proxy.began)
		incise_fixed_spring_set(&plan->plane, plan->plane_N_mm, origin,
					plan->incision.side);
	add_fixed(plan->force_N, &plan->plane, tick->tool_mm, plan->p0_mm, false);
	return 0;
}

/* Paper 2, Fd. */
int incise_stage_damping(struct incise_plan *plan, struct incise_tick *tick)
{
	if (tick->phase != INCISE_PHASE_FREE)
		incise_effect_damping(plan->force_N, plan->damping_N_s_mm,
				      plan->velocity_mm_s);
	return 0;
}

/*
 * Paper 2, Fy, with Fort. A handle that lies along the cut goes in easily, a tube, which is
 * round, in whatever turn; beside the cut skin holds up either.
 */
int incise_stage_insertion(struct incise_plan *plan, struct incise_tick *tick)
{
	double aligned = plan->scene->tissue.aligned, factor = 1, flat[3];

	if (tick->phase != INCISE_PHASE_INSERTION)
		return 0;
	if (plan->proxy.began)
		plan->in_incision = incise_incision_holds(
			&plan->incision, plan->proxy.first.point_mm, REACH_MM);
	if (plan->in_incision && tick->tool == INCISE_TOOL_TUBE) {
		factor = aligned;
	} else if (plan->in_incision) {
		v3_rotate(flat, plan->attitude, plan->instrument.side);
		factor = incise_orientation_factor(flat, plan->incision.along, aligned);
	}
	incise_effect_reaction(plan->force_N,
			       plan->insertion_N_mm * plan->depth_mm * factor,
			       plan->normal);
	return 0;
}

/* Paper 2, Fxz: the tissue around an instrument gives way to a limited extent. */
int incise_stage_spread(struct incise_plan *plan, struct incise_tick *tick)
{
	if (tick->phase == INCISE_PHASE_INSERTION)
		incise_effect_spread(plan->force_N, plan->spread_N_mm, tick->tool_mm,
				     plan->p0_mm, plan->normal);
	return 0;
}
