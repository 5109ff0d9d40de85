// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tick in double; see tick.h.
 */
#include <math.h>
#include <string.h>
#include "tick.h"
#include "../number/double.h"

#include "front.proto.c"
#include "incision.proto.c"
#include "tear.proto.c"
#include "tick.proto.c"

_Static_assert(PLACES == INCISE_CUT_PLACES, "as many as a cut has");

/*
 * Below this depth the direction from tool to proxy is rounding: the surface's own normal takes its
 * place. Positions within 10 m are good to 2e-12 mm.
 */
#define SHALLOW_MM 1e-6

/*
 * Bhasin et al.'s Sn = (Q - P)/|Q - P|, which is no direction where Q and P meet. Where the proxy is the
 * nearest point of a smooth surface it is the surface's normal.
 */
static void take_touch(struct incise_double_touch *to, const struct incise_touch *touch,
		       const double tool_mm[3])
{
	double out[3];

	v3_copy(to->point, touch->point_mm);
	to->depth = touch->depth_mm;
	v3_sub(out, touch->point_mm, tool_mm);
	if (touch->face < 0 || !(touch->depth_mm > SHALLOW_MM) ||
	    !v3_unit(to->normal, out, SHALLOW_MM))
		v3_copy(to->normal, touch->normal);
}

void incise_double_surface_move(const struct incise_double_plan *plan,
				struct incise_double_proxy *proxy, const double tool[3])
{
	const struct incise_proxy *there = plan->proxy;

	incise_proxy_move(plan->proxy, tool);
	proxy->touching = there->touching;
	proxy->began = there->began;
	if (there->began) {
		/* The normal at the place itself, not a direction from the tool. */
		v3_copy(proxy->first.point, there->first.point_mm);
		v3_copy(proxy->first.normal, there->first.normal);
		proxy->first.depth = there->first.depth_mm;
	}
	if (there->touching)
		take_touch(&proxy->touch, &there->touch, tool);
}

double incise_double_surface_above(const struct incise_double_plan *plan,
				   const double place[3])
{
	struct incise_touch touch;

	incise_surface_nearest(plan->proxy->surface, place, &touch);
	return -touch.depth_mm;
}

void incise_double_surface_restart(const struct incise_double_plan *plan)
{
	incise_proxy_init(plan->proxy, plan->proxy->surface, plan->proxy->leave_mm);
}

uint32_t incise_double_model_inputs(const struct incise_double_plan *plan, int32_t phase)
{
	return plan->inputs[phase];
}

double incise_double_model_force(const struct incise_double_plan *plan, int32_t phase,
				 const double *x, bool *outside)
{
	const struct incise_fixed *compiled = plan->compiled;
	double at[INCISE_LOOP_INPUTS_MAX];
	uint32_t kinds = plan->inputs[phase];
	unsigned int flags = 0;
	int n = 0;

	for (; kinds; n++, kinds >>= 4)
		at[n] = plan->holds >> (kinds & 15) & 1 ? plan->held[kinds & 15] : x[n];
	if (plan->model[phase]) {
		double force_N = incise_model_eval(plan->model[phase], at, &flags);

		*outside |= flags != 0;
		return force_N;
	}
	/* In a search for swings; its ticks are in integers. */
	for (int i = 0; i < n; i++)
		*outside |= at[i] * INCISE_FIXED_ONE < compiled->input[i].min ||
			    at[i] * INCISE_FIXED_ONE > compiled->input[i].max;
	return incise_fixed_eval_double(compiled, at);
}

double incise_double_texture_at(const struct incise_double_plan *plan,
				const struct incise_double_way *way, double *factor)
{
	const struct incise_fixed_texture *texture = plan->texture;
	uint32_t cut = way->number % INCISE_TEXTURE_CUTS, from;
	double at = way->most * INCISE_FIXED_ONE / (1 << texture->step_shift), a, b;

	/* Nor is NaN below. */
	at = at < 1e15 ? at : 0;
	from = texture->start[cut] + (uint32_t)(int64_t)at;
	a = texture->knot[from % INCISE_TEXTURE_KNOTS];
	b = texture->knot[(from + 1) % INCISE_TEXTURE_KNOTS];
	*factor = texture->factor[cut] / (double)INCISE_FIXED_ONE;
	return 1 + (a + (at - floor(at)) * (b - a)) / INCISE_TEXTURE_ONE;
}

void incise_double_plan_begin(const struct incise_double_plan *plan,
			      struct incise_double_state *state)
{
	struct incise_double_ends *ends = state->ends;

	*state = (struct incise_double_state){
		.held = INCISE_TOOL_BLADE,
		.ends = ends,
		.average = state->average,
		.incision = state->incision,
	};
	state->wanted = plan->numbers.inserts ? INCISE_TOOL_AUTO : INCISE_TOOL_BLADE;
	incise_double_predict_init(&state->scalpel);
	if (!ends)
		return;
	incise_double_predict_init(&ends->handle);
	incise_double_predict_init(&ends->tube);
}
