// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a plan says of itself: stages, memory, stability, and how far it is from exact.
 *
 * A part of one noun: tests/unit/scene/plan.c tests it through its door.
 */
#include "../model/model.h"
#include "plan.h"

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

	size += plan->fed ? INCISE_PLAN_POSES * sizeof(*plan->fed) : 0;
	size += plan->handle ? sizeof(*plan->handle) : 0;
	size += plan->average ? sizeof(*plan->average) : 0;
	size += plan->guard ? sizeof(*plan->guard) : 0;
	if (plan->fixed)
		size += sizeof(*plan->fixed) + plan->fixed->size;
	if (plan->scene->model)
		size += sizeof(*plan->scene->model);
	return size;
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

double incise_plan_bound(const struct incise_plan *plan, double reach_mm)
{
	double bound_N = 0;

	if (plan->fixed)
		bound_N = plan->gain * incise_fixed_bound(plan->fixed);
	else if (plan->scene->fixed && plan->reaction_N_mm > 0)
		bound_N = incise_fixed_spring_bound(plan->reaction_N_mm, reach_mm);
	if (plan->scene->fixed && plan->plane_N_mm > 0)
		bound_N += incise_fixed_spring_bound(plan->plane_N_mm, reach_mm);
	return bound_N;
}
