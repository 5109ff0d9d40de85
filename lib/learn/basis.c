// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Premises of a grid model, for learning; see basis.h.
 *
 * In a grid Σ_r w(r) = Π_i Σ_k A(i,k): each input's degrees are normalised alone, and a
 * rule's normalised strength is their product. Degrees are divided by the largest in the
 * log domain first, so they never all vanish.
 *
 * Rules count through the grid with the last input fastest, as incise_model_new_grid()
 * makes them.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "basis.h"

/* As lib/model has them: distances beyond are not distinguished, sums stay finite. */
#define Z_MAX 1e150
#define LOG_MIN (-1e300)

/* Firing strengths computed in two ways agree to rounding, or the model is no grid. */
#define SAME 1e-9

static bool is_grid(const struct incise_basis *basis, const struct incise_model *model)
{
	double x[INCISE_MODEL_INPUTS_MAX];
	double a[INCISE_MODEL_RULES_MAX], b[INCISE_MODEL_RULES_MAX];
	int n = 1;

	for (int i = 0; i < basis->n_inputs; i++)
		n *= basis->n_mfs[i];
	if (n != basis->n_rules)
		return false;
	for (int r = 0; r < n; r++)
		for (int i = basis->n_inputs - 1, rest = r; i >= 0; i--) {
			if (incise_model_rule(model, r)->mf[i] != rest % basis->n_mfs[i])
				return false;
			rest /= basis->n_mfs[i];
		}
	/*
	 * Weights and other ways to say 'and' show in the strengths. At the centres of each
	 * rule its own exponent is 0: nothing is lost to rounding, however thin functions are.
	 */
	for (int r = 0; r < n; r++) {
		for (int i = 0; i < basis->n_inputs; i++)
			x[i] = basis->p[incise_basis_centre(
				basis, i, incise_model_rule(model, r)->mf[i])];
		incise_basis_firing(basis, x, a);
		incise_model_firing(model, x, b);
		for (int k = 0; k < n; k++)
			if (!(fabs(a[k] - b[k]) < SAME))
				return false;
	}
	return true;
}

int incise_basis_init(struct incise_basis *basis, const struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);

	memset(basis, 0, sizeof(*basis));
	basis->n_inputs = info->n_inputs;
	basis->n_rules = info->n_rules;
	for (int i = 0; i < basis->n_inputs; i++) {
		basis->n_mfs[i] = info->n_mfs[i];
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);
			int n = incise_mf_n_params(mf->type);

			if (mf->type != INCISE_MF_GAUSS && mf->type != INCISE_MF_GBELL)
				return -ENOTSUP;
			basis->type[i][k] = mf->type;
			basis->at[i][k] = basis->n_premises;
			memcpy(basis->p + basis->n_premises, mf->p, n * sizeof(double));
			basis->n_premises += n;
		}
	}
	if (info->and_method != INCISE_AND_PROD)
		return -ENOTSUP;
	return is_grid(basis, model) ? 0 : -ENOTSUP;
}

void incise_basis_store(const struct incise_basis *basis, struct incise_model *model)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			const double *from = basis->p + basis->at[i][k];
			double p[4] = {from[0], from[1]};

			if (basis->type[i][k] == INCISE_MF_GBELL)
				p[2] = from[2];
			incise_model_set_mf(model, i, k, p);
		}
}

int incise_basis_centre(const struct incise_basis *basis, int input, int mf)
{
	return basis->at[input][mf] + (basis->type[input][mf] == INCISE_MF_GBELL ? 2 : 1);
}

static double log_degree(enum incise_mf_type type, const double *p, double x)
{
	double z, t;

	if (type == INCISE_MF_GAUSS) {
		z = fmin(fabs((x - p[1]) / p[0]), Z_MAX);
		return -0.5 * z * z;
	}
	z = fmin(fabs((x - p[2]) / p[0]), Z_MAX);
	t = 2 * p[1] * log(z);
	return fmax(t > 40 ? -t : -log1p(exp(t)), LOG_MIN);
}

typedef double v4 __attribute__((vector_size(32)));
typedef int64_t i4 __attribute__((vector_size(32)));

/* Below, exp() is taken as 0: its result is nearly subnormal. */
#define EXP_MIN (-708.0)

/*
 * exp() of numbers up to 0, to less than a unit in the last place (the method of fdlibm), with the
 * same bits on every machine: the C library's differ with the processor. n up to a multiple
 * of 4 is read and written.
 */
static void exponentials(double *values, int n)
{
	const double log2_e = 1.44269504088896338700,
		     ln2_high = 6.93147180369123816490e-01,
		     ln2_low = 1.90821492927058770002e-10, whole = 0x1.8p52;

	for (int at = 0; at < n; at += 4) {
		v4 x, k, bits, high, low, r, t, c, y;
		i4 inside, power;

		memcpy(&x, values + at, sizeof(x));
		inside = x >= EXP_MIN;
		x = (v4)((i4)x & inside);
		bits = x * log2_e + whole;
		k = bits - whole;
		high = x - k * ln2_high;
		low = k * ln2_low;
		r = high - low;
		t = r * r;
		c = r - t * (1.66666666666666019037e-01 +
			     t * (-2.77777777770155933842e-03 +
				  t * (6.61375632143793436117e-05 +
				       t * (-1.65339022054652515390e-06 +
					    t * 4.13813679705723846039e-08))));
		y = 1 - ((low - (r * c) / (2 - c)) - high);
		/* The lowest bits of `bits` are k: shifted, they are 2ᵏ but for the bias. */
		power = ((i4)bits << 52) + (1023LL << 52);
		y = y * (v4)power;
		y = (v4)((i4)y & inside);
		memcpy(values + at, &y, sizeof(y));
	}
}

void incise_basis_firing(const struct incise_basis *basis, const double *x, double *w)
{
	double degree[INCISE_MODEL_MFS_MAX + 3] = {0};
	int n = 1;

	w[0] = 1;
	for (int i = 0; i < basis->n_inputs; i++) {
		int n_mfs = basis->n_mfs[i];
		double largest = -INFINITY, sum = 0;

		for (int k = 0; k < n_mfs; k++) {
			degree[k] = log_degree(basis->type[i][k],
					       basis->p + basis->at[i][k], x[i]);
			largest = fmax(largest, degree[k]);
		}
		for (int k = 0; k < n_mfs; k++)
			degree[k] -= largest;
		exponentials(degree, n_mfs);
		for (int k = 0; k < n_mfs; k++)
			sum += degree[k];
		for (int k = 0; k < n_mfs; k++)
			degree[k] /= sum;
		/* From the last, because the results grow over their sources. */
		for (int r = n - 1; r >= 0; r--) {
			double above = w[r];

			for (int k = n_mfs - 1; k >= 0; k--)
				w[r * n_mfs + k] = above * degree[k];
		}
		n *= n_mfs;
	}
}

void incise_basis_slopes(const struct incise_basis *basis, const double *x,
			 double *slopes)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			const double *p = basis->p + basis->at[i][k];
			double *g = slopes + basis->at[i][k];
			double d, z, off;

			if (basis->type[i][k] == INCISE_MF_GAUSS) {
				z = (x[i] - p[1]) / p[0];
				g[0] = z * z / p[0];
				g[1] = z / p[0];
				continue;
			}
			d = x[i] - p[2];
			z = fabs(d / p[0]);
			/* 1 - A */
			off = -expm1(log_degree(INCISE_MF_GBELL, p, x[i]));
			g[0] = 2 * p[1] / p[0] * off;
			g[1] = z > 0 ? -2 * log(z) * off : 0;
			g[2] = d != 0 ? 2 * p[1] / d * off : 0;
		}
}

void incise_basis_shares(const struct incise_basis *basis, const double *w,
			 const double *f, double y, double *shares)
{
	double part[INCISE_MODEL_RULES_MAX];
	int inner = basis->n_rules;

	for (int r = 0; r < basis->n_rules; r++)
		part[r] = w[r] * (f[r] - y);
	for (int i = 0; i < basis->n_inputs; i++) {
		int n_mfs = basis->n_mfs[i];

		inner /= n_mfs;
		for (int k = 0; k < n_mfs; k++) {
			double sum = 0;

			for (int r = k * inner; r < basis->n_rules; r += n_mfs * inner)
				for (int j = 0; j < inner; j++)
					sum += part[r + j];
			*shares++ = sum;
		}
	}
}

void incise_basis_row(const struct incise_basis *basis, const double *w, const double *x,
		      double *row)
{
	int d = basis->n_inputs;

	for (int r = 0; r < basis->n_rules; r++, row += d + 1) {
		row[0] = w[r];
		for (int i = 0; i < d; i++)
			row[i + 1] = w[r] * x[i];
	}
}

double incise_basis_output(const struct incise_basis *basis, const double *w,
			   const double *x, const double *consequents, double *f)
{
	int d = basis->n_inputs;
	double y = 0;

	for (int r = 0; r < basis->n_rules; r++, consequents += d + 1) {
		f[r] = consequents[0];
		for (int i = 0; i < d; i++)
			f[r] += consequents[i + 1] * x[i];
		y += w[r] * f[r];
	}
	return y;
}

double incise_basis_error(const struct incise_basis *basis, const double *x,
			  const double *consequents)
{
	double w[INCISE_MODEL_RULES_MAX], f[INCISE_MODEL_RULES_MAX];

	incise_basis_firing(basis, x, w);
	return incise_basis_output(basis, w, x, consequents, f) - x[basis->n_inputs];
}

void incise_basis_fold(const struct incise_basis *basis, const struct incise_pairs *pairs,
		       struct incise_lsq *lsq)
{
	double w[INCISE_MODEL_RULES_MAX];
	int d = pairs->n_inputs;

	incise_lsq_reset(lsq);
	for (size_t n = 0; n < pairs->n; n++) {
		const double *x = pairs->rows + n * (d + 1);

		incise_basis_firing(basis, x, w);
		incise_basis_row(basis, w, x, incise_lsq_row(lsq));
		incise_lsq_add_weighted(lsq, x[d], incise_pairs_weight(pairs, n));
	}
}

int incise_basis_set_consequents(struct incise_model *model, const double *consequents)
{
	const struct incise_model_info *info = incise_model_info(model);
	int n = info->n_inputs + 1;

	for (int r = 0; r < info->n_rules; r++)
		if (incise_model_set_consequent(model, r, consequents + r * n))
			return -EDOM;
	return 0;
}

/* --- placement --- */

/* Share of the even spacing in that of the centres. */
#define EVEN 0.1

static void place_input(struct incise_basis *basis, int input, const double *sorted,
			size_t n_pairs)
{
	double centre[INCISE_MODEL_MFS_MAX];
	int n = basis->n_mfs[input];

	for (int k = 0; k < n; k++) {
		double even = (double)k / (n - 1);
		double quantile = k == 0       ? 0
				  : k == n - 1 ? 1
					       : sorted[(size_t)(even * (n_pairs - 1))];

		centre[k] = EVEN * even + (1 - EVEN) * quantile;
	}
	for (int k = 0; k < n; k++) {
		double left = k ? centre[k] - centre[k - 1] : HUGE_VAL,
		       right = k < n - 1 ? centre[k + 1] - centre[k] : HUGE_VAL,
		       half = fmin(left, right) / 2;
		double *p = basis->p + basis->at[input][k];

		p[0] = basis->type[input][k] == INCISE_MF_GAUSS ? half / sqrt(2 * M_LN2)
								: half;
		basis->p[incise_basis_centre(basis, input, k)] = centre[k];
	}
}

int incise_basis_place(struct incise_basis *basis, const struct incise_pairs *pairs)
{
	double *column = malloc(pairs->n * sizeof(*column));

	for (int i = 0; i < basis->n_inputs && column; i++) {
		if (basis->n_mfs[i] < 2)
			continue;
		for (size_t n = 0; n < pairs->n; n++)
			column[n] = pairs->rows[n * (pairs->n_inputs + 1) + i];
		qsort(column, pairs->n, sizeof(*column), ascending);
		place_input(basis, i, column, pairs->n);
	}
	free(column);
	return column ? 0 : -ENOMEM;
}
