// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Evaluating a compiled fuzzy model with integers; see incise/fixed.h.
 *
 *   per input, per function    z = (x - centre)·slope        Q24, held within ±128
 *                              q = z²                        Q26
 *                              μ = 2^-(q - smallest q)       Q30
 *   per rule                   w = Π μ                       Q30
 *   output                     y = Σ w·(p0 + Σ p·x) / Σ w    Q(y_shift), then Q16
 *
 * Taking the smallest exponent of each input away first does not change the quotient,
 * and makes the largest weight of the grid 1: the sum of weights is never 0.
 */
#include <incise/fixed.h>

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
static int64_t exponent(const struct incise_fixed_mf *mf, int32_t x)
{
	int64_t z = ((((int64_t)x - mf->centre) * mf->slope) >> mf->shift) - mf->offset;

	if (z > Z_MAX)
		z = Z_MAX;
	if (z < -Z_MAX)
		z = -Z_MAX;
	return (z * z) >> 22;
}

/* Degrees of one input's functions, the largest of them 1. */
static void degrees(const struct incise_fixed_input *in, int32_t x, uint32_t *mu)
{
	int64_t q[INCISE_FIXED_MFS_MAX];
	int64_t least = INT64_MAX;

	for (int k = 0; k < in->n_mfs; k++) {
		q[k] = exponent(&in->mf[k], x);
		if (q[k] < least)
			least = q[k];
	}
	for (int k = 0; k < in->n_mfs; k++)
		mu[k] = exp2_neg(q[k] - least);
}

int32_t incise_fixed_eval(const struct incise_fixed *fx, const int32_t *x)
{
	uint32_t mu[INCISE_FIXED_INPUTS_MAX][INCISE_FIXED_MFS_MAX];
	int32_t at[INCISE_FIXED_INPUTS_MAX] = {0};
	int32_t in[INCISE_FIXED_INPUTS_MAX];
	int shift = fx->p_shift + 16 - fx->y_shift;
	int64_t sum = 0, weights = 0, y;

	for (int i = 0; i < fx->n_inputs; i++) {
		in[i] = x[i] < fx->input[i].min ? fx->input[i].min : x[i];
		in[i] = in[i] > fx->input[i].max ? fx->input[i].max : in[i];
		degrees(&fx->input[i], in[i], mu[i]);
	}
	for (int r = 0; r < fx->n_rules; r++) {
		const int64_t *p = fx->p[r];
		int64_t rule = p[0] * INCISE_FIXED_ONE;
		uint64_t w = mu[0][at[0]];

		for (int i = 1; i < fx->n_inputs; i++)
			w = (w * mu[i][at[i]]) >> 30;
		for (int i = 0; i < fx->n_inputs; i++)
			rule += p[i + 1] * in[i];
		sum += (int64_t)w * (rule >> shift);
		weights += (int64_t)w;
		for (int i = fx->n_inputs - 1; i >= 0 && ++at[i] == fx->input[i].n_mfs;
		     i--)
			at[i] = 0;
	}
	y = sum / weights;
	y = (y + ((int64_t)1 << (fx->y_shift - 17))) >> (fx->y_shift - 16);
	if (y > INT32_MAX)
		return INT32_MAX;
	return y < INT32_MIN ? INT32_MIN : (int32_t)y;
}
