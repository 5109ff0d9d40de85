// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The width of the prediction interval; see interval.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "interval.h"

/* The 97.5 % quantile of Student's t for 1 … degrees of freedom, to 0.1 %. */
static double find_student(double n)
{
	static const double few[] = {12.706, 4.303, 3.182, 2.776, 2.571};
	const double z = INCISE_INTERVAL95;

	if (n <= 5)
		return few[(int)n - 1];
	/* Cornish and Fisher's expansion. */
	return z + (pow(z, 3) + z) / (4 * n) +
	       (5 * pow(z, 5) + 16 * pow(z, 3) + 3 * z) / (96 * n * n);
}

/* The noise follows an input between such shares of its values from both ends. */
#define TAIL 0.02

/* The logarithms of errors below this share of their median say nothing about the noise. */
#define ERROR_LEAST 0.5

/* The slopes are held down as if by so many pairs of the whole range. */
#define SLOPE_PAIRS 1

/* Shares of the slopes that are tried; above 1, as small errors count as ERROR_LEAST and flatten them. */
#define SHARES 9
#define SHARE_STEP 0.25

/* Fewer units than these have no quantile: Student's t widens the one of so many. */
#define UNITS_MANY 18

/* Units are partly alike, so what holds 95 % of a new one is between this share and (n+1)/n of it. */
#define LEVEL(units) fmin(0.95 * (1 + 0.75 / (units)), 0.99)

double incise_interval_widening(uint64_t units)
{
	if (!units || units >= UNITS_MANY)
		return 1;
	return find_student(fmax(units - 1, 1)) / find_student(UNITS_MANY - 1);
}

/* The held-out pairs, fold by fold. */
struct held {
	const struct incise_folds *folds;
	const double *ratios;
	int d;
	double *x; /* d inputs of each, 0 … 1 between the ends of the shape, less their mean */
	double *along;	/* Σ slope·x, with slopes that this fold had no part in */
	double *sorted; /* room for one number of each */
	struct incise_lsq *lsq;
};

static double quantile_of(double *values, size_t n, double share)
{
	qsort(values, n, sizeof(*values), ascending);
	return values[(size_t)fmax(ceil(share * (double)n), 1) - 1];
}

/* An input of all pairs by the ends that are found. Returns its mean, which is subtracted. */
static double place_input(struct held *h, int input, double *low, double *high)
{
	size_t n = h->folds->n_held, at = 0;
	double mean = 0;

	for (int f = 0; f < h->folds->n; f++)
		for (size_t i = 0; i < h->folds->held[f].n; i++, at++)
			h->sorted[at] = h->x[at * h->d + input] =
				h->folds->held[f].rows[i * (h->d + 1) + input];
	*low = quantile_of(h->sorted, n, TAIL);
	*high = quantile_of(h->sorted, n, 1 - TAIL);
	if (!(*high > *low))
		*high = *low + 1;
	for (size_t i = 0; i < n; i++) {
		double *x = &h->x[i * h->d + input];

		*x = (fmax(*low, fmin(*high, *x)) - *low) / (*high - *low);
		mean += *x / (double)n;
	}
	for (size_t i = 0; i < n; i++)
		h->x[i * h->d + input] -= mean;
	return mean;
}

static double product_of(const double *a, const double *b, int n)
{
	double sum = 0;

	for (int i = 0; i < n; i++)
		sum += a[i] * b[i];
	return sum;
}

/* Slopes of log|error| over the other folds, over all of them if fold is -1. */
static int fit_slopes(struct held *h, int fold, double least, double *slope)
{
	double *row, x[INCISE_MODEL_INPUTS_MAX + 1];
	size_t at = 0;
	int rc;

	incise_lsq_reset(h->lsq);
	for (int f = 0; f < h->folds->n; f++)
		for (size_t i = 0; i < h->folds->held[f].n; i++, at++) {
			if (f == fold)
				continue;
			row = incise_lsq_row(h->lsq);
			for (int k = 0; k < h->d; k++)
				row[k] = h->x[at * h->d + k];
			row[h->d] = 1;
			incise_lsq_add(h->lsq, log(fmax(fabs(h->ratios[at]), least)));
		}
	for (int k = 0; k < h->d; k++) {
		row = incise_lsq_row(h->lsq);
		for (int j = 0; j <= h->d; j++)
			row[j] = j == k ? SLOPE_PAIRS : 0;
		incise_lsq_add(h->lsq, 0);
	}
	rc = incise_lsq_solve(h->lsq, NULL, x);
	for (int k = 0; k < h->d; k++)
		slope[k] = x[k];
	return rc;
}

/* The quantile of the errors in units of the noise by a share of the slopes. */
static double find_quantile(const struct held *h, double share, double level)
{
	for (size_t i = 0; i < h->folds->n_held; i++)
		h->sorted[i] = fabs(h->ratios[i]) * exp(-share * h->along[i]);
	return quantile_of(h->sorted, h->folds->n_held, level);
}

/* The interval score of a share of the slopes, less is better. */
static double score_share(const struct held *h, double share)
{
	double quantile = find_quantile(h, share, 0.95), sum = 0;

	for (size_t i = 0; i < h->folds->n_held; i++) {
		double half = quantile * exp(share * h->along[i]);

		sum += half + 1 / 0.05 * fmax(0, fabs(h->ratios[i]) - half);
	}
	return sum;
}

double incise_common_variance(const struct incise_unit *unit, int n_units, double square,
			      double *within)
{
	double all = 0, n = 0, between = 0;

	for (int i = 0; i < n_units; i++) {
		n += unit[i].n > 0;
		all += unit[i].n;
		between += unit[i].n > 0 ? unit[i].sum * unit[i].sum / unit[i].n : 0;
	}
	*within = (square - between) / (all - n);
	return all > n ? fmax(0, (between / n - *within) * n / all) : 0;
}

/*
 * The share of the noise's variance that the pairs of a unit have in common over the number of units; 0 where
 * a unit is one pair.
 */
static int find_shared(const struct held *h, const double *slope, double *shared)
{
	int n_units = h->folds->n_units, n = 0;
	struct incise_unit *unit = calloc((size_t)n_units, sizeof(*unit));
	double square = 0, within, common;
	size_t at = 0;

	if (!unit)
		return -ENOMEM;
	for (int f = 0; f < h->folds->n; f++)
		for (size_t i = 0; i < h->folds->held[f].n; i++, at++) {
			struct incise_unit *u = &unit[h->folds->unit[f][i]];
			double e = h->ratios[at] *
				   exp(-product_of(slope, h->x + at * h->d, h->d));

			n += u->n == 0;
			u->n++;
			u->sum += e;
			square += e * e;
		}
	common = incise_common_variance(unit, n_units, square, &within);
	free(unit);
	*shared = common > 0 ? common / (common + within) / n : 0;
	return 0;
}

/* Find all of the interval; the room of the pairs is there. */
static int fit_interval(struct held *h, struct incise_interval *interval)
{
	struct incise_uncertainty_shape *shape = &interval->shape;
	int units = h->folds->n_units, rc = 0;
	double mean[INCISE_MODEL_INPUTS_MAX], slope[INCISE_MODEL_INPUTS_MAX];
	double least, share = 0, lowest = INFINITY, square = 0;
	size_t n = h->folds->n_held, at = 0;

	for (int k = 0; k < h->d; k++)
		mean[k] = place_input(h, k, &shape->low[k], &shape->high[k]);
	least = fmax(ERROR_LEAST * find_quantile(h, 0, 0.5), 1e-12);
	for (int f = 0; f < h->folds->n && !rc; f++) {
		rc = fit_slopes(h, f, least, slope);
		for (size_t i = 0; i < h->folds->held[f].n && !rc; i++, at++)
			h->along[at] = product_of(slope, h->x + at * h->d, h->d);
	}
	if (!rc)
		rc = fit_slopes(h, -1, least, slope);
	for (int i = 0; i < SHARES && !rc; i++) {
		double score = score_share(h, SHARE_STEP * i);

		if (score < lowest) {
			lowest = score;
			share = SHARE_STEP * i;
		}
	}
	if (rc)
		return rc;
	for (int k = 0; k < h->d; k++)
		shape->slope[k] = share * slope[k];
	for (size_t i = 0; i < n; i++)
		square += exp(2 * product_of(shape->slope, h->x + i * h->d, h->d));
	square = sqrt(square / (double)n);
	shape->offset = -product_of(shape->slope, mean, h->d) - log(square);
	interval->noise =
		find_quantile(h, share, LEVEL(units)) * square / INCISE_INTERVAL95;
	interval->noise *= incise_interval_widening((uint64_t)units);
	return find_shared(h, shape->slope, &shape->shared);
}

int incise_interval_fit(const struct incise_folds *folds, const double *ratios,
			struct incise_interval *interval)
{
	size_t n = folds->n_held;
	struct held h = {.folds = folds, .ratios = ratios, .d = folds->held[0].n_inputs};
	int rc = -ENOMEM;

	h.x = malloc(n * (size_t)h.d * sizeof(*h.x));
	h.along = calloc(n, sizeof(*h.along));
	h.sorted = malloc(n * sizeof(*h.sorted));
	h.lsq = incise_lsq_new(h.d + 1, folds->watch);
	memset(interval, 0, sizeof(*interval));
	if (h.x && h.along && h.sorted && h.lsq)
		rc = fit_interval(&h, interval);
	free(h.x);
	free(h.along);
	free(h.sorted);
	incise_lsq_free(h.lsq);
	return rc;
}

int incise_interval_noise(const struct incise_basis *basis,
			  const struct incise_folds *folds,
			  const struct incise_ridge *ridge,
			  struct incise_interval *interval)
{
	double *ratios = malloc(folds->n_held * sizeof(*ratios));
	int rc = ratios ? incise_crossval_ratios(basis, folds, ridge, ratios) : -ENOMEM;

	if (!rc)
		rc = incise_interval_fit(folds, ratios, interval);
	free(ratios);
	return rc;
}
