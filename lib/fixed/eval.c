// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Evaluating a compiled model: clamp the inputs, run its arithmetic, saturate the output.
 */
#include "layout.h"

int32_t incise_fixed_eval(const struct incise_fixed *fx, const int32_t *x)
{
	uint32_t from_min[INCISE_FIXED_INPUTS_MAX];
	int64_t y = 0;

	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];
		int32_t at = x[i] < in->min ? in->min : x[i];

		at = at > in->max ? in->max : at;
		from_min[i] = (uint32_t)at - (uint32_t)in->min;
	}
	switch (fx->arithmetic) {
	case INCISE_FIXED_DIRECT:
		y = incise_fx_direct(fx, from_min);
		break;
	case INCISE_FIXED_TABLE:
		y = incise_fx_table(fx, from_min);
		break;
	case INCISE_FIXED_FORCE:
		y = incise_fx_force(fx, from_min);
		break;
	}
	if (y > INT32_MAX)
		return INT32_MAX;
	return y < INT32_MIN ? INT32_MIN : (int32_t)y;
}
