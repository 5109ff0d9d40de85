/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Random inputs, the same in a kernel and in a program: they show that both compute the same
 * bits. Seed s, then for k = 0 … n-1 in this order:
 *
 *   x[0], x[1] …     of the evaluator, a quarter of the support beyond either end too
 *   spring, p        of the plane constraint: any numbers: all are safe, see spring.h
 */
#ifndef INCISE_FX_TRIAL_H
#define INCISE_FX_TRIAL_H

#include <incise/fixed.h>

#include "../../lib/fixed/spring.h"

/* CRC-32C of 10 000 results of seed 1 without an evaluator: 0, force, stretch; 5 int32. */
#define INCISE_FX_TRIAL_SPRINGS 0x35716354u

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

/* Half of them near enough to the anchor that nothing is held, half anywhere. */
static inline void incise_fx_trial_spring(uint64_t *state,
					  struct incise_fixed_spring *spring,
					  int32_t p[3])
{
	int shift = incise_fx_trial_next(state) >> 63 ? 10 : 0;

	spring->stiffness = incise_fx_trial_number(state) >> shift;
	for (int i = 0; i < 3; i++) {
		spring->anchor[i] = incise_fx_trial_number(state) >> shift;
		spring->direction[i] = incise_fx_trial_number(state) >> 1;
		p[i] = incise_fx_trial_number(state) >> shift;
	}
}

#endif
