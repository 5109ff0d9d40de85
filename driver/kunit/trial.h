/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Random inputs, the same in a kernel and in a program: they show that both compute the same
 * bits. Seed s, then for k = 0 … n-1 in this order:
 *
 *   x[0], x[1] …     of the evaluator, a quarter of the support beyond either end too
 *   a cut            for the stages reaction and plane: any numbers, at which sums are held too
 *   a texture        for plans
 */
#ifndef INCISE_FX_TRIAL_H
#define INCISE_FX_TRIAL_H

#include <incise/fixed.h>

#include "../../lib/fixed/plan.h"
#include "../../lib/fixed/vector.h"

/* Too large for a kernel's stack. Begins with {0}. */
struct incise_fx_trial_cut {
	struct incise_fixed_plan plan;
	struct incise_fixed_state state;
	struct incise_fixed_tick tick;
};

/* xorshift64 (G. Marsaglia, 'Xorshift RNGs', 2003); never 0. */
static inline uint64_t incise_fx_trial_next(uint64_t *state)
{
	uint64_t s = *state ? *state : 88172645463325252u;

	s ^= s << 13;
	s ^= s >> 7;
	s ^= s << 17;
	*state = s;
	return s;
}

static inline int32_t incise_fx_trial_number(uint64_t *state)
{
	return (int32_t)(uint32_t)(incise_fx_trial_next(state) >> 32);
}

static inline void incise_fx_trial_inputs(uint64_t *state, const struct incise_fixed *fx,
					  int32_t *x)
{
	for (int i = 0; i < fx->n_inputs; i++) {
		uint64_t range = (uint64_t)((int64_t)fx->input[i].max - fx->input[i].min);
		uint64_t wide = range + range / 2;
		/* A fraction of 32 bits of it, so that no division is needed. */
		uint64_t part = (incise_fx_trial_next(state) >> 32) * wide >> 32;
		int64_t v = fx->input[i].min - (int64_t)(range / 4) + (int64_t)part;

		if (v > INT32_MAX)
			v = INT32_MAX;
		x[i] = v < INT32_MIN ? INT32_MIN : (int32_t)v;
	}
}

/* The force of both stages. Half of the numbers are so small that nothing is held, half are any. */
static inline void incise_fx_trial_force(uint64_t *state, struct incise_fx_trial_cut *cut,
					 int32_t force[3])
{
	int shift = incise_fx_trial_next(state) >> 63 ? 10 : 0;

	cut->plan.numbers.reaction = (incise_fx_trial_number(state) & INT32_MAX) >> shift;
	cut->plan.numbers.plane = (incise_fx_trial_number(state) & INT32_MAX) >> shift;
	cut->state.depth = (incise_fx_trial_number(state) & INT32_MAX) >> shift;
	for (int i = 0; i < 3; i++) {
		cut->state.p0[i] = incise_fx_trial_number(state) >> shift;
		cut->state.normal[i] = incise_fx_trial_number(state) >> 1;
		cut->state.side[i] = incise_fx_trial_number(state) >> 1;
		cut->tick.tool[i] = incise_fx_trial_number(state) >> shift;
		cut->state.force[i] = 0;
	}
	cut->tick.phase = INCISE_PHASE_CUTTING;
	incise_fixed_stage_reaction(&cut->plan, &cut->state, &cut->tick);
	incise_fixed_stage_plane(&cut->plan, &cut->state, &cut->tick);
	incise_fx_copy(force, cut->state.force);
}

/* A saw-tooth that falls from knot to knot, up to @most of INCISE_TEXTURE_ONE. */
static inline void incise_fx_trial_texture(uint64_t *state, int32_t most,
					   struct incise_fixed_texture *to)
{
	int32_t rise, at = 0;

	*to = (struct incise_fixed_texture){
		.step_shift = 8 + (incise_fx_trial_number(state) & INT32_MAX) % 13,
		.most = most,
		.factor_most = 2 << 16,
	};
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
		to->factor[i] = 1 << 15;
		to->factor[i] += (incise_fx_trial_number(state) & INT32_MAX) % (3 << 15);
		to->start[i] = (uint16_t)(incise_fx_trial_number(state) &
					  (INCISE_TEXTURE_KNOTS - 1));
	}
	rise = 1 + (incise_fx_trial_number(state) & 1023);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++) {
		bool falls =
			at + rise > most || !(incise_fx_trial_number(state) & 15 << 20);

		at = falls ? at - (incise_fx_trial_number(state) & INT32_MAX) %
					     (at + most + 1)
			   : at + rise;
		to->knot[i] = (int16_t)at;
	}
}

#endif
