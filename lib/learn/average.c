// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Averaging of ridge fits; see average.h.
 *
 * All fits solve normal equations in the same sums, with a penalty that is large against
 * rounding in every direction the pairs leave open:
 *
 *   none:  G = Σ φφᵀ                         over the pairs
 *   cuts:  G = Σ φφᵀ - Σ k·(Σ φz)(Σ φz)ᵀ     inner sums over the pairs of a cut, outer over cuts
 *
 * The second is generalised least squares with the covariance 1 + τ·zzᵀ of the pairs of a cut,
 * k = τ/(1 + τ·zᵀz) (Sherman and Morrison), for z the force that the first average predicts: a
 * cut is harder or softer as a whole, by a random factor.
 *
 *        n   1
 *     ┌────┬───┐
 *     │ G  │ b │  n rows, upper triangle
 *     └────┴───┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "average.h"

/* Strengths of the penalty on differences of neighbouring rules, per input. */
static const double strengths[] = {3e-3, 0.1, 3, 100, 1e4};
#define STRENGTHS ((int)(sizeof(strengths) / sizeof(*strengths)))

/* With more combinations than those of two inputs, all inputs have the same strength. */
#define COMBINATIONS_MAX (STRENGTHS * STRENGTHS)

/* So strong that rules do not differ. */
#define RIGID 1e8

/* Penalty on the mean of all rules: its slopes, and just enough to be defined. */
#define SLOPES 1e-3
#define CONSTANT 1e-6

/* Variance of a cut's factor, as a share of the noise at an output of one deviation. */
#define CUT_VARIANCE 0.05

/* Multiplications of all factorisations together: a few seconds. */
#define BUDGET 5e9

/* Weights below change no digit that matters. */
#define WEIGHT_MIN 1e-4

struct setting {
	double strength[INCISE_MODEL_INPUTS_MAX], slopes;
	bool cuts; /* random factors */
	double total, weight;
};

#define SETTINGS_MAX (2 * (COMBINATIONS_MAX + 2))

struct incise_average {
	int n, stride, n_inputs, n_rules;
	int n_mfs[INCISE_MODEL_INPUTS_MAX];
	int n_settings;
	struct setting setting[SETTINGS_MAX];
	double *all;  /* G and b of all tuned pairs */
	double *held; /* of the held pairs of each fold */
	double *cuts; /* √k·(Σ φz, Σ tz) of each unit; NULL without random factors */
	bool *out;    /* fold × unit: it is held out */
	int n_units;
	double *consequents; /* work: settings × n */
	double *matrix;	     /* work: a triangle */
	struct incise_watch *watch;
};

static size_t triangle(const struct incise_average *a)
{
	return (size_t)a->n * a->stride;
}

static void add_setting(struct incise_average *a, const double *strength, double slopes,
			bool cuts)
{
	struct setting *setting = &a->setting[a->n_settings++];

	*setting = (struct setting){.slopes = slopes, .cuts = cuts};
	memcpy(setting->strength, strength, a->n_inputs * sizeof(*strength));
}

/* All settings without random factors, then all again with them. */
static void make_settings(struct incise_average *a, bool cuts)
{
	double strength[INCISE_MODEL_INPUTS_MAX];
	int combinations = 1, d = a->n_inputs;

	for (int i = 0; i < d && combinations <= COMBINATIONS_MAX; i++)
		combinations *= STRENGTHS;
	if (combinations > COMBINATIONS_MAX)
		combinations = STRENGTHS;
	for (int with = 0; with <= cuts; with++) {
		for (int k = 0; k < combinations; k++) {
			for (int i = 0, rest = k; i < d; i++) {
				strength[i] = strengths[rest % STRENGTHS];
				if (combinations > STRENGTHS)
					rest /= STRENGTHS;
			}
			add_setting(a, strength, SLOPES, with);
		}
		for (int i = 0; i < d; i++)
			strength[i] = RIGID;
		add_setting(a, strength, SLOPES, with);
		add_setting(a, strength, RIGID, with);
	}
}

/* --- normal equations --- */

static void add_average_row(double *matrix, int n, int stride, const double *row,
			    double factor)
{
	for (int i = 0; i < n; i++) {
		double *to = matrix + (size_t)i * stride, by = factor * row[i];

		if (by == 0)
			continue;
		for (int k = i; k <= n; k++)
			to[k] += by * row[k];
	}
}

static void add_penalty(const struct incise_average *a, const struct setting *setting,
			double *matrix)
{
	int width = a->n_inputs + 1, inner = a->n_rules;

	for (int i = 0; i < a->n_inputs; i++) {
		double by = setting->strength[i];

		inner /= a->n_mfs[i];
		/* Rule r and its neighbour along input i, all parameters. */
		for (int r = 0; r + inner < a->n_rules; r++) {
			if (r / inner % a->n_mfs[i] == a->n_mfs[i] - 1)
				continue;
			for (int c = 0; c < width; c++) {
				size_t p = (size_t)r * width + c,
				       q = p + (size_t)inner * width;

				matrix[p * a->stride + p] += by;
				matrix[q * a->stride + q] += by;
				matrix[p * a->stride + q] -= by;
			}
		}
	}
	for (int p = 0; p < a->n; p++)
		for (int q = p; q < a->n; q += width)
			matrix[(size_t)p * a->stride + q] +=
				(p % width ? setting->slopes : CONSTANT) / a->n_rules;
}

/* Cholesky's factor and the right side with it, in place; false if that is impossible. */
static bool factorise(double *matrix, int n, int stride)
{
	for (int j = 0; j < n; j++) {
		double *row = matrix + (size_t)j * stride, pivot = sqrt(row[j]);

		if (!(pivot > 0) || !isfinite(pivot))
			return false;
		for (int k = j; k <= n; k++)
			row[k] /= pivot;
		for (int i = j + 1; i < n; i++) {
			double *to = matrix + (size_t)i * stride, by = row[i];

			for (int k = i; k <= n; k++)
				to[k] -= by * row[k];
		}
	}
	return true;
}

/* Subtract the random factors of the cuts that a fold does not hold out; f < 0: of all. */
static void subtract_cuts(const struct incise_average *a, int f, double *matrix)
{
	for (int u = 0; u < a->n_units; u++)
		if (f < 0 || !a->out[(size_t)f * a->n_units + u])
			add_average_row(matrix, a->n, a->stride,
					a->cuts + (size_t)u * a->stride, -1);
}

/* The equations of a fold's other pairs, f < 0: of all, without penalty. */
static void equations(const struct incise_average *a, int f, bool cuts, double *matrix)
{
	const double *held = a->held + f * (ptrdiff_t)triangle(a);

	memcpy(matrix, a->all, triangle(a) * sizeof(*matrix));
	for (size_t i = 0; f >= 0 && i < triangle(a); i++)
		matrix[i] -= held[i];
	if (cuts)
		subtract_cuts(a, f, matrix);
}

/* Solve equations with a setting's penalty; its factor is left in a->matrix. */
static bool solve_average(const struct incise_average *a, const double *equations,
			  const struct setting *setting, double *consequents)
{
	memcpy(a->matrix, equations, triangle(a) * sizeof(*equations));
	add_penalty(a, setting, a->matrix);
	return !incise_watch_count(a->watch, pow(a->n, 3) / 3) &&
	       factorise(a->matrix, a->n, a->stride) &&
	       !incise_lsq_back(a->matrix, a->stride, a->n, a->n, consequents);
}

/* Sums of rows of pairs; the row is (φ, t). */
static void make_row(const struct incise_basis *basis, const double *x, double *row)
{
	double w[INCISE_MODEL_RULES_MAX];
	int n = basis->n_rules * (basis->n_inputs + 1);

	incise_basis_firing(basis, x, w);
	incise_basis_row(basis, w, x, row);
	row[n] = x[basis->n_inputs];
}

static double dot(const double *row, const double *consequents, int n)
{
	double sum = 0;

	for (int i = 0; i < n; i++)
		sum += row[i] * consequents[i];
	return sum;
}

/* The sums of each fold, and of all pairs: the first division holds each out once. */
static void sum_up(struct incise_average *a, const struct incise_basis *basis,
		   const struct incise_folds *folds, size_t n_pairs)
{
	double *row = a->consequents;
	size_t seen = 0;

	for (int f = 0; f < folds->n; f++) {
		const struct incise_pairs *held = &folds->held[f];
		double *to = a->held + f * triangle(a);

		for (size_t i = 0; i < held->n; i++) {
			make_row(basis, held->rows + i * (held->n_inputs + 1), row);
			add_average_row(to, a->n, a->stride, row,
					incise_pairs_weight(held, i));
			a->out[(size_t)f * a->n_units + folds->unit[f][i]] = true;
		}
		for (size_t i = 0; seen < n_pairs && i < triangle(a); i++)
			a->all[i] += to[i];
		seen += held->n;
	}
}

/* √k·(Σ φz, Σ tz) of each cut, for z the force that consequents predict. */
static int sum_cuts(struct incise_average *a, const struct incise_basis *basis,
		    const struct incise_folds *folds, size_t n_pairs,
		    const double *consequents)
{
	double *squares = calloc(a->n_units, sizeof(*squares));
	double *row = malloc(a->stride * sizeof(*row));
	size_t seen = 0;

	a->cuts = calloc((size_t)a->n_units * a->stride, sizeof(*a->cuts));
	for (int f = 0; f < folds->n && seen < n_pairs && squares && row && a->cuts;
	     f++) {
		const struct incise_pairs *held = &folds->held[f];

		for (size_t i = 0; i < held->n; i++) {
			int u = folds->unit[f][i];
			double *to = a->cuts + (size_t)u * a->stride, z, weight;

			make_row(basis, held->rows + i * (held->n_inputs + 1), row);
			z = dot(row, consequents, a->n) - folds->zero;
			weight = incise_pairs_weight(held, i);
			squares[u] += weight * z * z;
			for (int k = 0; k <= a->n; k++)
				to[k] += weight * z * row[k];
		}
		seen += held->n;
	}
	for (int u = 0; u < a->n_units && squares && a->cuts; u++)
		for (int k = 0; k <= a->n; k++)
			a->cuts[(size_t)u * a->stride + k] *=
				sqrt(CUT_VARIANCE / (1 + CUT_VARIANCE * squares[u]));
	free(squares);
	free(row);
	return squares && row && a->cuts ? 0 : -ENOMEM;
}

/* --- weights --- */

/* Held-out predictions of the settings from … to, a row per pair, and their errors. */
static int predict(struct incise_average *a, const struct incise_basis *basis,
		   const struct incise_folds *folds, int from, int to, double *predicted)
{
	bool cuts = a->setting[from].cuts;
	double *whole = malloc(triangle(a) * sizeof(*whole));
	double *row = malloc(a->stride * sizeof(*row));
	int rc = whole && row ? 0 : -ENOMEM;

	for (int f = 0; f < folds->n && !rc; f++) {
		const struct incise_pairs *held = &folds->held[f];

		equations(a, f, cuts, whole);
		for (int s = from; s < to; s++)
			if (!solve_average(a, whole, &a->setting[s],
					   a->consequents + (size_t)s * a->n))
				a->setting[s].total = HUGE_VAL;
		for (size_t i = 0; i < held->n; i++, predicted += SETTINGS_MAX) {
			make_row(basis, held->rows + i * (held->n_inputs + 1), row);
			for (int s = from; s < to; s++) {
				double e;

				if (a->setting[s].total == HUGE_VAL)
					continue;
				predicted[s] =
					dot(row, a->consequents + (size_t)s * a->n, a->n);
				e = predicted[s] - row[a->n];
				a->setting[s].total +=
					incise_pairs_weight(held, i) * e * e;
			}
		}
	}
	free(whole);
	free(row);
	return rc;
}

/*
 * Weights of the first n settings: (error/least)^-units. Few units forgive a larger error, for
 * the least one is then so by chance.
 */
static int weigh(struct incise_average *a, int n)
{
	double least = HUGE_VAL, sum = 0;

	for (int s = 0; s < n; s++)
		least = fmin(least, a->setting[s].total);
	if (!isfinite(least))
		return -EDOM;
	for (int s = 0; s < n; s++) {
		struct setting *setting = &a->setting[s];

		setting->weight = exp(-a->n_units * log(setting->total / least));
		if (!(least > 0))
			setting->weight = setting->total == 0;
		if (!(setting->weight >= WEIGHT_MIN))
			setting->weight = 0;
		sum += setting->weight;
	}
	for (int s = 0; s < n; s++)
		a->setting[s].weight /= sum;
	return 0;
}

static const struct setting *heaviest(const struct incise_average *a)
{
	const struct setting *best = &a->setting[0];

	for (int s = 1; s < a->n_settings; s++)
		if (a->setting[s].weight > best->weight)
			best = &a->setting[s];
	return best;
}

/* The weighted sum of the consequents of the first n settings, from their equations. */
static int average(const struct incise_average *a, const double *plain,
		   const double *cuts, int n, double *consequents)
{
	double *one = a->consequents;

	memset(consequents, 0, a->n * sizeof(*consequents));
	for (int s = 0; s < n; s++) {
		const struct setting *setting = &a->setting[s];

		if (!(setting->weight > 0))
			continue;
		if (!solve_average(a, setting->cuts ? cuts : plain, setting, one))
			return -EDOM;
		for (int k = 0; k < a->n; k++)
			consequents[k] += setting->weight * one[k];
	}
	return 0;
}

static void sum_errors(const struct incise_average *a, const struct incise_folds *folds,
		       const double *predicted, double *error)
{
	int d = a->n_inputs;

	memset(error, 0, folds->n_units * sizeof(*error));
	for (int f = 0; f < folds->n; f++)
		for (size_t i = 0; i < folds->held[f].n; i++, predicted += SETTINGS_MAX) {
			double e = -folds->held[f].rows[i * (d + 1) + d];

			for (int s = 0; s < a->n_settings; s++)
				if (a->setting[s].weight > 0)
					e += a->setting[s].weight * predicted[s];
			error[folds->unit[f][i]] +=
				incise_pairs_weight(&folds->held[f], i) * e * e;
		}
}

/* The settings with random factors follow when the others have predicted the force. */
static int find_average(struct incise_average *a, const struct incise_basis *basis,
			const struct incise_folds *folds, double *error)
{
	double *predicted = malloc(folds->n_held * SETTINGS_MAX * sizeof(*predicted));
	double *consequents = malloc(a->n * sizeof(*consequents));
	size_t n_pairs = folds->fit[0].n + folds->held[0].n;
	int plain = folds->cuts ? a->n_settings / 2 : a->n_settings;
	int rc = predicted && consequents ? 0 : -ENOMEM;

	if (!rc) {
		sum_up(a, basis, folds, n_pairs);
		rc = predict(a, basis, folds, 0, plain, predicted);
	}
	if (!rc)
		rc = weigh(a, plain);
	if (!rc && folds->cuts) {
		rc = average(a, a->all, NULL, plain, consequents);
		if (!rc)
			rc = sum_cuts(a, basis, folds, n_pairs, consequents);
		if (!rc)
			rc = predict(a, basis, folds, plain, a->n_settings, predicted);
		if (!rc)
			rc = weigh(a, a->n_settings);
	}
	if (!rc && error)
		sum_errors(a, folds, predicted, error);
	free(predicted);
	free(consequents);
	return rc;
}

int incise_average_find(struct incise_average **average, const struct incise_basis *basis,
			const struct incise_folds *folds, double *error)
{
	struct incise_average *a = calloc(1, sizeof(*a));
	int rc = -ENOMEM;

	*average = NULL;
	if (!a)
		return rc;
	a->n_inputs = basis->n_inputs;
	a->n_rules = basis->n_rules;
	memcpy(a->n_mfs, basis->n_mfs, sizeof(a->n_mfs));
	a->n = basis->n_rules * (basis->n_inputs + 1);
	a->stride = a->n + 1;
	a->n_units = folds->n_units;
	a->watch = folds->watch;
	make_settings(a, folds->cuts);
	if (pow(a->n, 3) / 6 * a->n_settings * folds->n > BUDGET) {
		rc = -E2BIG;
		goto out;
	}
	a->all = calloc(triangle(a), sizeof(*a->all));
	a->held = calloc(triangle(a) * folds->n, sizeof(*a->held));
	a->out = calloc((size_t)folds->n * a->n_units, sizeof(*a->out));
	a->consequents =
		calloc((size_t)(a->n_settings + 1) * a->stride, sizeof(*a->consequents));
	a->matrix = calloc(triangle(a), sizeof(*a->matrix));
	if (a->all && a->held && a->out && a->consequents && a->matrix)
		rc = find_average(a, basis, folds, error);
out:
	if (rc)
		incise_average_free(a);
	else
		*average = a;
	return rc;
}

void incise_average_free(struct incise_average *a)
{
	if (!a)
		return;
	free(a->all);
	free(a->held);
	free(a->cuts);
	free(a->out);
	free(a->consequents);
	free(a->matrix);
	free(a);
}

/* --- all pairs --- */

/* G = RᵀR and b = Rᵀz of a factor; with random factors of all cuts, or without. */
static double *multiply(const struct incise_average *a, struct incise_lsq *lsq, bool cuts)
{
	int stride;
	const double *factor = incise_lsq_factor(lsq, NULL, &stride);
	double *matrix = factor ? calloc(triangle(a), sizeof(*matrix)) : NULL;

	if (!matrix) {
		errno = factor ? ENOMEM : EDOM;
		return NULL;
	}
	for (int r = 0; r < a->n; r++) {
		const double *row = factor + (size_t)r * stride;

		for (int i = r; i < a->n; i++)
			for (int k = i; k <= a->n; k++)
				matrix[(size_t)i * a->stride + k] += row[i] * row[k];
	}
	if (cuts)
		subtract_cuts(a, -1, matrix);
	return matrix;
}

int incise_average_solve(const struct incise_average *a, struct incise_lsq *lsq,
			 double *consequents)
{
	double *plain = multiply(a, lsq, false);
	double *cuts = plain && a->cuts ? multiply(a, lsq, true) : NULL;
	int rc = plain && (cuts || !a->cuts) ? 0 : -errno;

	if (!rc)
		rc = average(a, plain, cuts, a->n_settings, consequents);
	free(plain);
	free(cuts);
	return rc;
}

double *incise_average_factor(const struct incise_average *a, struct incise_lsq *lsq,
			      int *stride)
{
	const struct setting *setting = heaviest(a);
	double *matrix = multiply(a, lsq, setting->cuts);

	if (!matrix)
		return NULL;
	add_penalty(a, setting, matrix);
	*stride = a->stride;
	if (factorise(matrix, a->n, a->stride))
		return matrix;
	free(matrix);
	errno = EDOM;
	return NULL;
}

int incise_average_ratios(const struct incise_average *a,
			  const struct incise_basis *basis,
			  const struct incise_folds *folds, double *ratios)
{
	const struct setting *best = heaviest(a);
	double *plain = malloc(triangle(a) * sizeof(*plain));
	double *cuts = malloc(triangle(a) * sizeof(*cuts));
	double *consequents = malloc(a->n * sizeof(*consequents));
	double *row = malloc(a->stride * sizeof(*row));
	int rc = plain && cuts && consequents && row ? 0 : -ENOMEM;

	for (int f = 0; f < folds->n && !rc; f++) {
		const struct incise_pairs *held = &folds->held[f];

		equations(a, f, false, plain);
		if (a->cuts)
			equations(a, f, true, cuts);
		rc = average(a, plain, cuts, a->n_settings, consequents);
		if (!rc &&
		    !solve_average(a, best->cuts ? cuts : plain, best, a->consequents))
			rc = -EDOM;
		for (size_t i = 0; i < held->n && !rc; i++) {
			double e;

			make_row(basis, held->rows + i * (held->n_inputs + 1), row);
			e = dot(row, consequents, a->n) - row[a->n];
			*ratios++ = e / sqrt(1 + incise_lsq_leverage(a->matrix, a->stride,
								     a->n, row));
		}
	}
	free(plain);
	free(cuts);
	free(consequents);
	free(row);
	return rc;
}

struct incise_average_shares incise_average_shares(const struct incise_average *a)
{
	struct incise_average_shares shares = {0};

	for (int s = 0; s < a->n_settings; s++) {
		const struct setting *setting = &a->setting[s];

		shares.settings += setting->weight >= 0.01;
		if (setting->strength[0] == RIGID)
			*(setting->slopes == RIGID ? &shares.mean : &shares.plane) +=
				setting->weight;
		if (setting->cuts)
			shares.cuts += setting->weight;
	}
	return shares;
}
