// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A compiled model by exponentials: small, and without a table.
 *
 *   per input, per function    z = (x - centre)·slope        Q24, held within ±128
 *                              q = z²                        Q26
 *                              μ = 2^-(q - smallest q)       Q30
 *   per rule                   w = Π μ                       Q30
 *   output                     y = Σ w·(p0 + Σ p·x) / Σ w    Q(shift_b), then Q16
 *
 * Taking the smallest exponent of each input away first does not change the quotient,
 * and makes the largest weight of the grid 1: the sum of weights is never 0.
 */
#include "division.h"
#include "layout.h"

#define Z_MAX (((int64_t)1 << 31) - 1)

/* 2^-f on 0 ≤ f < 1, Q30: minimax polynomial of degree 6, error 1.3e-9 (1.4 LSB). */
static const int32_t exp2_c[] = {1073741823, -744260977, 257938963, -59583156,
				 10286722,   -1369979,	 117517};

/* 2^-q for q ≥ 0 in Q26; Q30, 0 … 2^30. */
static uint32_t exp2_neg(int64_t q)
{
	int64_t f = q & ((1 << 26) - 1);
	int64_t a = exp2_c[6];

	if (q >= (int64_t)31 << 26)
		return 0;
	for (int i = 5; i >= 0; i--)
		a = ((a * f) >> 26) + exp2_c[i];
	return (uint32_t)(a >> (q >> 26));
}

/* z² in Q26. */
static int64_t exponent(const struct incise_fx_mf *mf, int64_t x)
{
	int64_t distance = x - (int32_t)incise_fx_le32(mf->centre);
	int64_t z = ((distance * (int32_t)incise_fx_le32(mf->slope)) >>
		     incise_fx_le32(mf->shift)) -
		    (int32_t)incise_fx_le32(mf->offset);

	if (z > Z_MAX)
		z = Z_MAX;
	if (z < -Z_MAX)
		z = -Z_MAX;
	return (z * z) >> 22;
}

/* Degrees of one input's functions, the largest of them 1. */
static void degrees(const struct incise_fixed_input *in, int64_t x, uint32_t *mu)
{
	const struct incise_fx_mf *mf = (const struct incise_fx_mf *)in->values;
	int64_t q[INCISE_FIXED_MFS_MAX];
	int64_t least = INT64_MAX;

	for (int k = 0; k < in->n_mfs; k++) {
		q[k] = exponent(&mf[k], x);
		if (q[k] < least)
			least = q[k];
	}
	for (int k = 0; k < in->n_mfs; k++)
		mu[k] = exp2_neg(q[k] - least);
}

int64_t incise_fx_direct(const struct incise_fixed *fx, const uint32_t *from_min)
{
	uint32_t a[INCISE_FIXED_MFS_MAX], b[INCISE_FIXED_MFS_MAX] = {1 << 30};
	int64_t x[INCISE_FIXED_INPUTS_MAX] = {0};
	int n = fx->n_inputs, n_b = n > 1 ? fx->input[1].n_mfs : 1;
	int shift = fx->shift_a + 16 - fx->shift_b;
	const int64_t *p = fx->data;
	int64_t sum = 0, weights = 0, y;

	for (int i = 0; i < n; i++) {
		x[i] = (int64_t)fx->input[i].min + from_min[i];
		degrees(&fx->input[i], x[i], i ? b : a);
	}
	for (int i = 0; i < fx->input[0].n_mfs; i++)
		for (int j = 0; j < n_b; j++, p += n + 1) {
			int64_t w = (int64_t)(((uint64_t)a[i] * b[j]) >> 30);
			int64_t rule = (int64_t)incise_fx_le64(p[0]) * INCISE_FIXED_ONE +
				       (int64_t)incise_fx_le64(p[1]) * x[0];

			if (n > 1)
				rule += (int64_t)incise_fx_le64(p[2]) * x[1];
			sum += w * (rule >> shift);
			weights += w;
		}
	y = div64_s64(sum, weights);
	return (y + ((int64_t)1 << (fx->shift_b - 17))) >> (fx->shift_b - 16);
}
