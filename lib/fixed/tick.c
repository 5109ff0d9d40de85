// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A tick of a plan in integers: lib/tissue's physics, and besides them the surfaces of a plan, its
 * model, and the targets of its actuators. See plan.h.
 */
#include "plan.h"
#include "../number/fixed.h"

#include "../tissue/predict.proto.c"
#include "../tissue/front.proto.c"
#include "../tissue/incision.proto.c"
#include "../tissue/tear.proto.c"
#include "../tissue/tick.proto.c"

_Static_assert(PLACES == INCISE_FIXED_CUT_PLACES, "as many as a cut has");

bool incise_fixed_shorten(int64_t v[3], int32_t most)
{
	uint64_t sum = 0;
	int64_t length;
	int shift = 0;

	/* Squares of 31 bits: 3 · 2^62 < 2^64. */
	for (int i = 0; i < 3; i++)
		while ((v[i] < 0 ? -v[i] : v[i]) >> shift > INT32_MAX)
			shift++;
	for (int i = 0; i < 3; i++) {
		int64_t part = (v[i] < 0 ? -v[i] : v[i]) >> shift;

		part += shift ? 1 : 0;
		part = part < INT32_MAX ? part : INT32_MAX;
		sum += (uint64_t)(part * part);
	}
	/* Mostly it is: without a root. 2^28 squared. */
	if (!shift && sum <= (uint64_t)((int64_t)most * most))
		return false;
	length = incise_fx_root(sum);
	length += (uint64_t)length * (uint64_t)length < sum;
	length <<= shift;
	if (length <= most)
		return false;
	for (int i = 0; i < 3; i++)
		v[i] = div64_s64(v[i] * most, length);
	return true;
}

/* --- surface and model ------------------------------------------------------------------ */

void incise_fixed_surface_move(const struct incise_fixed_plan *plan,
			       struct incise_fixed_proxy *proxy, const int32_t tool[3])
{
	if (plan->surface)
		plan->surface->move(plan->surface->context, tool, proxy);
	else
		incise_fixed_proxy_move(proxy, &plan->numbers.shape, &plan->grid,
					plan->numbers.leave, tool);
}

int32_t incise_fixed_surface_above(const struct incise_fixed_plan *plan,
				   const int32_t place[3])
{
	struct incise_fixed_touch touch;

	if (plan->surface)
		return plan->surface->above(plan->surface->context, place);
	if (!incise_fixed_shape_nearest(&plan->numbers.shape, &plan->grid, place,
					plan->numbers.up, &touch))
		return INT32_MAX;
	return n_neg(touch.depth);
}

void incise_fixed_surface_restart(const struct incise_fixed_plan *plan)
{
	if (plan->surface)
		plan->surface->restart(plan->surface->context);
}

/* There is the model of the cut only. */
uint32_t incise_fixed_model_inputs(const struct incise_fixed_plan *plan, int32_t phase)
{
	(void)phase;
	return (uint32_t)plan->numbers.inputs;
}

int32_t incise_fixed_model_force(const struct incise_fixed_plan *plan, int32_t phase,
				 const int32_t *x, bool *outside)
{
	const struct incise_fixed *model = &plan->model;

	(void)phase;
	for (int i = 0; i < model->n_inputs; i++)
		*outside |= x[i] < model->input[i].min || x[i] > model->input[i].max;
	return incise_fixed_eval(model, x);
}

int32_t incise_fixed_texture_at(const struct incise_fixed_plan *plan,
				const struct incise_fixed_way *way, int32_t *factor)
{
	const struct incise_fixed_texture *texture = plan->texture;
	uint32_t cut = way->number % INCISE_TEXTURE_CUTS, shift, from;
	int64_t part, a, b;

	shift = (uint32_t)texture->step_shift;
	from = texture->start[cut] + (uint32_t)(way->most >> shift);
	part = way->most & ((1 << shift) - 1);
	a = texture->knot[from % INCISE_TEXTURE_KNOTS];
	b = texture->knot[(from + 1) % INCISE_TEXTURE_KNOTS];
	*factor = texture->factor[cut];
	/* 2^16 · 2^20, of Q14 in Q16 */
	return (int32_t)(N(1) + incise_fx_rounded(a * (1 << shift) + (b - a) * part,
						  (int)shift - 2));
}

/* --- ticks ------------------------------------------------------------------------------ */

void incise_fixed_plan_begin(const struct incise_fixed_plan *plan,
			     struct incise_fixed_state *state)
{
	*state = (struct incise_fixed_state){.held = INCISE_TOOL_BLADE};
	state->wanted = plan->numbers.inserts ? INCISE_TOOL_AUTO : INCISE_TOOL_BLADE;
	incise_fixed_predict_init(&state->scalpel);
	incise_fixed_predict_init(&state->ends.handle);
	incise_fixed_predict_init(&state->ends.tube);
	for (int i = 0; i < plan->numbers.n_axes; i++)
		state->place[i] = plan->numbers.axes[i].rest;
	incise_fixed_surface_restart(plan);
}

/*
 * Where the handle is along the axis: the tracker's pose says it. Without a fresh one it is where it
 * was; before the first, where the spring is at rest.
 */
static void aim(const struct incise_fixed_axis *axis, int32_t *place,
		struct incise_fixed_tick *tick, int i)
{
	const int32_t no_origin[3] = {0};
	int32_t off[3];
	int64_t sum = 0, nut, held;

	if (!(tick->flags & INCISE_TICK_STALE)) {
		incise_fx_sub(off, tick->tool, no_origin);
		*place = incise_fx_hold32((int64_t)incise_fx_along(off, axis->direction) -
					  axis->origin);
	}
	/* 3 · 2^28 · 2^31 in Q40 */
	for (int k = 0; k < 3; k++)
		sum += (int64_t)tick->command[k] * axis->dual[k];
	tick->along[i] = incise_fx_hold32(incise_fx_rounded(sum, 24));
	/* 2^31 · 2^31 in Q36 */
	nut = *place + incise_fx_rounded((int64_t)tick->along[i] * axis->compliance, 20);
	held = incise_fx_within(nut, 0, axis->travel);
	/* Less than a step beyond is where its position is read to. */
	if ((nut > held ? nut - held : held - nut) >
	    div64_s64(1LL << 32, axis->steps_per_mm))
		tick->flags |= INCISE_TICK_TRAVEL;
	/* 2^31 · 2^31 in Q32 */
	tick->target[i] = (int32_t)incise_fx_rounded(held * axis->steps_per_mm, 32);
}

void incise_fixed_plan_tick(const struct incise_fixed_plan *plan,
			    struct incise_fixed_state *state, int64_t t_ns,
			    struct incise_fixed_tick *tick)
{
	*tick = (struct incise_fixed_tick){.t_ns = t_ns};
	incise_fixed_stage_predict(plan, state, tick);
	incise_fixed_stage_tool(plan, state, tick);
	incise_fixed_stage_contact(plan, state, tick);
	incise_fixed_stage_normal(plan, state, tick);
	incise_fixed_stage_incision(plan, state, tick);
	incise_fixed_stage_membrane(plan, state, tick);
	incise_fixed_stage_texture(plan, state, tick);
#define FORCE(row, name, ...) incise_fixed_stage_##name(plan, state, tick);
#define NUMBER(...)
#define MORE(member)
#include "../tissue/forces.def"
	incise_fixed_stage_start(plan, state, tick);
	incise_fixed_stage_work(plan, state, tick);
	incise_fixed_stage_limit(plan, state, tick);
	for (int i = 0; i < plan->numbers.n_axes; i++)
		aim(&plan->numbers.axes[i], &state->place[i], tick, i);
}
