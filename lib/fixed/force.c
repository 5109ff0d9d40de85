// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A compiled model by a table of its output, linear between knots in each input.
 */
#include "layout.h"

int64_t incise_fx_force(const struct incise_fixed *fx, const uint32_t *from_min)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	uint32_t cell = from_min[0] >> a->cell_shift;
	uint32_t frac = from_min[0] & ((1u << a->cell_shift) - 1);
	const int32_t *v = fx->data;
	int64_t from, to, y;

	if (fx->n_inputs == 1) {
		from = (int32_t)incise_fx_le32(v[cell]);
		to = (int32_t)incise_fx_le32(v[cell + 1]);
	} else {
		uint32_t width = (uint32_t)b->cells + 1;
		uint32_t frac_b = from_min[1] & ((1u << b->cell_shift) - 1);

		v += cell * width + (from_min[1] >> b->cell_shift);
		from = incise_fx_lerp(incise_fx_le32(v[0]), incise_fx_le32(v[1]), frac_b,
				      b->cell_shift);
		to = incise_fx_lerp(incise_fx_le32(v[width]),
				    incise_fx_le32(v[width + 1]), frac_b, b->cell_shift);
	}
	y = from + (((to - from) * frac) >> a->cell_shift);
	return (y + ((int64_t)1 << (fx->shift_a - 17))) >> (fx->shift_a - 16);
}
