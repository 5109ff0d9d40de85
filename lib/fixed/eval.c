// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Evaluates a compiled model: clamps the inputs, runs its arithmetic, saturates the output.
 * An arithmetic gets distances from the support's lower end, and returns Q16.16.
 */
#include "integers.h"
#include "layout.h"

/* From Q(shift) to Q16, to the nearest. */
static int64_t rounded(int64_t y, int shift)
{
	return (y + ((int64_t)1 << (shift - 17))) >> (shift - 16);
}

/*
 * --- direct: by exponentials, small and without a table ---
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
	int64_t distance = x - incise_fx_int32(mf->centre);
	int64_t z =
		((distance * incise_fx_int32(mf->slope)) >> incise_fx_int32(mf->shift)) -
		incise_fx_int32(mf->offset);

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

static int64_t direct(const struct incise_fixed *fx, const uint32_t *from_min)
{
	uint32_t a[INCISE_FIXED_MFS_MAX], b[INCISE_FIXED_MFS_MAX] = {1 << 30};
	int64_t x[INCISE_FIXED_INPUTS_MAX] = {0};
	int n = fx->n_inputs, n_b = n > 1 ? fx->input[1].n_mfs : 1;
	int shift = fx->shift_a + 16 - fx->shift_b;
	const int64_t *p = fx->data;
	int64_t sum = 0, weights = 0;

	for (int i = 0; i < n; i++) {
		x[i] = (int64_t)fx->input[i].min + from_min[i];
		degrees(&fx->input[i], x[i], i ? b : a);
	}
	for (int i = 0; i < fx->input[0].n_mfs; i++)
		for (int j = 0; j < n_b; j++, p += n + 1) {
			int64_t w = (int64_t)(((uint64_t)a[i] * b[j]) >> 30);
			int64_t rule = incise_fx_int64(p[0]) * INCISE_FIXED_ONE +
				       incise_fx_int64(p[1]) * x[0];

			if (n > 1)
				rule += incise_fx_int64(p[2]) * x[1];
			sum += w * (rule >> shift);
			weights += w;
		}
	return rounded(div64_s64(sum, weights), fx->shift_b);
}

/* The same for three inputs and more. The last input's functions come fastest. */
static int64_t direct_many(const struct incise_fixed *fx, const uint32_t *from_min)
{
	uint32_t mu[INCISE_FIXED_INPUTS_MAX][INCISE_FIXED_MFS_MAX];
	int64_t x[INCISE_FIXED_INPUTS_MAX], sum = 0, weights = 0;
	int32_t at[INCISE_FIXED_INPUTS_MAX] = {0};
	int n = fx->n_inputs, shift = fx->shift_a + 16 - fx->shift_b;
	const int64_t *p = fx->data;

	for (int i = 0; i < n; i++) {
		x[i] = (int64_t)fx->input[i].min + from_min[i];
		degrees(&fx->input[i], x[i], mu[i]);
	}
	for (int r = 0; r < fx->n_rules; r++, p += n + 1) {
		int64_t rule = incise_fx_int64(p[0]) * INCISE_FIXED_ONE;
		uint64_t w = 1 << 30;

		for (int i = 0; i < n; i++) {
			w = (w * mu[i][at[i]]) >> 30;
			rule += incise_fx_int64(p[i + 1]) * x[i];
		}
		sum += (int64_t)w * (rule >> shift);
		weights += (int64_t)w;
		for (int i = n - 1; i >= 0 && ++at[i] == fx->input[i].n_mfs; i--)
			at[i] = 0;
	}
	return rounded(div64_s64(sum, weights), fx->shift_b);
}

/* --- one input: both kinds of tables are the same, linear between knots --- */

static int64_t one_input(const struct incise_fixed *fx, const uint32_t *from_min)
{
	const struct incise_fixed_input *in = &fx->input[0];
	const int32_t *v = (const int32_t *)fx->data + (*from_min >> in->cell_shift);
	uint32_t frac = *from_min & ((1u << in->cell_shift) - 1);

	return rounded(incise_fx_lerp(v[0], v[1], frac, in->cell_shift), fx->shift_a);
}

/*
 * --- table: by tables of normalised weights, no exponential and no division ---
 *
 * With ā(i) and b̄(j) the normalised degrees of both inputs, and x1 counted from the middle
 * of its support,
 *
 *   y = Σi ā(i)(x1) · [ g(i)(x2) + x1·h(i)(x2) ]
 *   g(i) = Σj b̄(j)·(p(ij,0) + p(ij,2)·x2)    h(i) = Σj b̄(j)·p(ij,1)
 *
 * ā, g and h depend on one input each: they stand in tables.
 */

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
		int64_t w = incise_fx_lerp(weight[i], weight_to[i], frac, 30);

		g += w * incise_fx_int32(fold[2 * i]);
		h += w * incise_fx_int32(fold[2 * i + 1]);
		g_to += w * incise_fx_int32(fold_to[2 * i]);
		h_to += w * incise_fx_int32(fold_to[2 * i + 1]);
	}
	*sums = (struct sums){{g, g_to}, {h, h_to}};
}

static int64_t table(const struct incise_fixed *fx, const uint32_t *from_min)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	int n = a->n_mfs, to_g = 16 + fx->shift_b - fx->shift_a;
	const int32_t *weight, *fold;
	uint32_t frac_a, frac_b;
	struct sums sums;
	int64_t x, y[2];

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
	return rounded(y[0], fx->shift_a);
}

/* --- force: by a table of the output, linear between knots in each input --- */

static int64_t force(const struct incise_fixed *fx, const uint32_t *from_min)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	uint32_t frac = from_min[0] & ((1u << a->cell_shift) - 1);
	uint32_t frac_b = from_min[1] & ((1u << b->cell_shift) - 1);
	uint32_t width = (uint32_t)b->cells + 1;
	const int32_t *v = (const int32_t *)fx->data +
			   (from_min[0] >> a->cell_shift) * width +
			   (from_min[1] >> b->cell_shift);
	int64_t from = incise_fx_lerp(v[0], v[1], frac_b, b->cell_shift);
	int64_t to = incise_fx_lerp(v[width], v[width + 1], frac_b, b->cell_shift);

	return rounded(from + (((to - from) * frac) >> a->cell_shift), fx->shift_a);
}

int32_t incise_fixed_eval(const struct incise_fixed *fx, const int32_t *x)
{
	uint32_t from_min[INCISE_FIXED_INPUTS_MAX] = {0};
	int64_t y = 0;

	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];
		int32_t at = x[i] < in->min ? in->min : x[i];

		at = at > in->max ? in->max : at;
		from_min[i] = (uint32_t)at - (uint32_t)in->min;
	}
	switch (fx->arithmetic) {
	case INCISE_FIXED_DIRECT:
		y = fx->n_inputs > 2 ? direct_many(fx, from_min) : direct(fx, from_min);
		break;
	case INCISE_FIXED_TABLE:
		y = fx->n_inputs == 1 ? one_input(fx, from_min) : table(fx, from_min);
		break;
	case INCISE_FIXED_FORCE:
		y = fx->n_inputs == 1 ? one_input(fx, from_min) : force(fx, from_min);
		break;
	}
	if (y > INT32_MAX)
		return INT32_MAX;
	return y < INT32_MIN ? INT32_MIN : (int32_t)y;
}
