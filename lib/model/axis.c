// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Normalised degrees of one input; see axis.h. With L(i) = -(x-c(i))²/(2s(i)²) and
 * ⟨f⟩ = Σ ā(k) f(k):
 *
 *   ā(i)   = 1 / Σk exp(L(k) - L(i))
 *   ā(i)'  = ā(i) (L(i)' - ⟨L'⟩)
 *   ā(i)'' = ā(i) ((L(i)' - ⟨L'⟩)² + L(i)'' - ⟨L''⟩ - ⟨(L' - ⟨L'⟩)²⟩)
 */
#include "axis.h"

void incise_axis_init(struct incise_axis *axis, const struct incise_model *model,
		      int input)
{
	const struct incise_variable *v = incise_model_input(model, input);

	axis->n = incise_model_n_mfs(model, input);
	/* A compiled support ends at the nearest LSB, which may lie half an LSB outside. */
	axis->min = fmin(v->min, rint(v->min * INCISE_FIXED_ONE) / INCISE_FIXED_ONE);
	axis->max = fmax(v->max, rint(v->max * INCISE_FIXED_ONE) / INCISE_FIXED_ONE);
	for (int i = 0; i < axis->n; i++) {
		axis->s[i] = incise_model_mf(model, input, i)->p[0];
		axis->c[i] = incise_model_mf(model, input, i)->p[1];
	}
}

void incise_axis_at(const struct incise_axis *axis, long double x, long double *a)
{
	long double largest = -HUGE_VALL, sum = 0;

	for (int i = 0; i < axis->n; i++) {
		long double z = (x - axis->c[i]) / axis->s[i];

		a[i] = -z * z / 2;
		largest = fmaxl(largest, a[i]);
	}
	for (int i = 0; i < axis->n; i++) {
		a[i] = expl(a[i] - largest);
		sum += a[i];
	}
	for (int i = 0; i < axis->n; i++)
		a[i] /= sum;
}

/* L(k) - L(i) over [m-r, m+r] in mean-value form: its value at m, plus slope times ±r. */
static struct interval log_ratio(const struct incise_axis *axis, int k, int i,
				 struct interval x, const struct interval *slope)
{
	double m = x.lo + (x.hi - x.lo) / 2;
	struct interval zk = iv_scale(iv_sub(iv(m), iv(axis->c[k])), 1 / axis->s[k]);
	struct interval zi = iv_scale(iv_sub(iv(m), iv(axis->c[i])), 1 / axis->s[i]);
	struct interval at_m = iv_scale(iv_sub(iv_square(zi), iv_square(zk)), 0.5);
	struct interval off = iv_sub(x, iv(m));

	/* 1/s is rounded: two ulp of the squares more. */
	at_m = iv_add(at_m,
		      iv_scale((struct interval){-1, 1}, (zi.hi * zi.hi + zi.lo * zi.lo +
							  zk.hi * zk.hi + zk.lo * zk.lo) *
								 0x1p-50));
	return iv_add(at_m, iv_mul(iv_sub(slope[k], slope[i]), off));
}

void incise_axis_over(const struct incise_axis *axis, struct interval x,
		      struct incise_axis_range *range)
{
	struct interval slope[INCISE_FIXED_MFS_MAX], bend[INCISE_FIXED_MFS_MAX];
	struct interval mean = iv(0), mean_bend = iv(0), spread = iv(0);
	const struct interval unit = {0, 1};
	int n = axis->n;

	for (int i = 0; i < n; i++) {
		struct interval s2 = iv_square(iv(axis->s[i]));

		bend[i] = iv_scale(iv_inverse(s2), -1);
		slope[i] = iv_mul(iv_sub(x, iv(axis->c[i])), bend[i]);
	}
	for (int i = 0; i < n; i++) {
		struct interval sum = iv(1);

		for (int k = 0; k < n; k++)
			if (k != i)
				sum = iv_add(sum,
					     iv_exp(log_ratio(axis, k, i, x, slope)));
		range->a[i] = iv_intersect(iv_inverse(sum), unit);
	}
	for (int i = 0; i < n; i++) {
		mean = iv_add(mean, iv_mul(range->a[i], slope[i]));
		mean_bend = iv_add(mean_bend, iv_mul(range->a[i], bend[i]));
	}
	/* The weights add up to 1: a mean lies between the extremes. */
	for (int i = 0, lo = 0, hi = 0; i < n; i++) {
		lo = slope[i].lo < slope[lo].lo ? i : lo;
		hi = slope[i].hi > slope[hi].hi ? i : hi;
		if (i == n - 1)
			mean = iv_intersect(mean, (struct interval){slope[lo].lo,
								    slope[hi].hi});
	}
	for (int i = 0; i < n; i++)
		spread = iv_add(spread,
				iv_mul(range->a[i], iv_square(iv_sub(slope[i], mean))));
	for (int i = 0; i < n; i++) {
		struct interval off = iv_sub(slope[i], mean);

		range->d1[i] = iv_mul(range->a[i], off);
		range->d2[i] =
			iv_mul(range->a[i],
			       iv_sub(iv_add(iv_square(off), iv_sub(bend[i], mean_bend)),
				      spread));
	}
}
