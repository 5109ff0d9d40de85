// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A compiled model by tables of normalised weights: no exponential and no division.
 *
 * With ā(i) and b̄(j) the normalised degrees of both inputs, and x1 counted from the middle
 * of its support,
 *
 *   y = Σi ā(i)(x1) · [ g(i)(x2) + x1·h(i)(x2) ]
 *   g(i) = Σj b̄(j)·(p(ij,0) + p(ij,2)·x2)    h(i) = Σj b̄(j)·p(ij,1)
 *
 * ā, g and h depend on one input each: they stand in tables.
 */
#include "layout.h"

static int64_t one_input(const struct incise_fixed *fx, uint32_t from_min)
{
	const struct incise_fixed_input *in = &fx->input[0];
	const int32_t *row = (const int32_t *)fx->data + (from_min >> in->cell_shift);
	uint32_t frac = from_min & ((1u << in->cell_shift) - 1);
	int64_t y = incise_fx_lerp(incise_fx_le32(row[0]), incise_fx_le32(row[1]), frac,
				   in->cell_shift);

	return (y + ((int64_t)1 << (fx->shift_a - 17))) >> (fx->shift_a - 16);
}

/* Weighed sums over input a's functions, at the knots on both sides. Q(30 + shift). */
struct sums {
	int64_t g[2], h[2];
};

/*
 * Add up n functions. frac is a share of input a's cell as 2^30: shifting by a constant is
 * cheaper, and the floor is the same. Adding up before going between the knots of input
 * b takes fewer steps than the other way round.
 */
static inline __attribute__((always_inline)) void weigh(const int32_t *weight,
							const int32_t *fold,
							uint32_t frac, int n,
							struct sums *sums)
{
	const int32_t *weight_to = weight + n, *fold_to = fold + 2 * n;
	int64_t g = 0, h = 0, g_to = 0, h_to = 0;

#pragma GCC unroll 8
	for (int i = 0; i < n; i++) {
		int64_t w = incise_fx_lerp(incise_fx_le32(weight[i]),
					   incise_fx_le32(weight_to[i]), frac, 30);

		g += w * (int32_t)incise_fx_le32(fold[2 * i]);
		h += w * (int32_t)incise_fx_le32(fold[2 * i + 1]);
		g_to += w * (int32_t)incise_fx_le32(fold_to[2 * i]);
		h_to += w * (int32_t)incise_fx_le32(fold_to[2 * i + 1]);
	}
	*sums = (struct sums){{g, g_to}, {h, h_to}};
}

int64_t incise_fx_table(const struct incise_fixed *fx, const uint32_t *from_min)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	int n = a->n_mfs, to_g = 16 + fx->shift_b - fx->shift_a;
	const int32_t *weight, *fold;
	uint32_t frac_a, frac_b;
	struct sums sums;
	int64_t x, y[2];

	if (fx->n_inputs == 1)
		return one_input(fx, from_min[0]);
	weight = a->values + (from_min[0] >> a->cell_shift) * (uint32_t)n;
	frac_a = (from_min[0] & ((1u << a->cell_shift) - 1)) << (30 - a->cell_shift);
	fold = (const int32_t *)fx->data +
	       (from_min[1] >> b->cell_shift) * (uint32_t)(2 * n);
	frac_b = from_min[1] & ((1u << b->cell_shift) - 1);
	/* The paper's count, with its loop unrolled. */
	if (n == 5)
		weigh(weight, fold, frac_a, 5, &sums);
	else
		weigh(weight, fold, frac_a, n, &sums);
	x = (int64_t)from_min[0] - (((int64_t)a->max - a->min) >> 1);
	for (int k = 0; k < 2; k++)
		y[k] = (sums.g[k] >> 30) + ((x * (sums.h[k] >> 30)) >> to_g);
	y[0] += ((y[1] - y[0]) * frac_b) >> b->cell_shift;
	return (y[0] + ((int64_t)1 << (fx->shift_a - 17))) >> (fx->shift_a - 16);
}
