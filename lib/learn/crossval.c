// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Cross-validation over groups; see crossval.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "crossval.h"
#include "../base/random.h"

/* Number the groups that occur from 0, in order; returns how many, or -ENOMEM. */
static int count_groups(const int *groups, size_t n, int *unit)
{
	size_t n_groups = 0;
	int *number, next = 0;

	for (size_t i = 0; i < n; i++)
		if ((size_t)groups[i] + 1 > n_groups)
			n_groups = (size_t)groups[i] + 1;
	number = malloc(n_groups * sizeof(*number));
	if (!number)
		return -ENOMEM;
	for (size_t g = 0; g < n_groups; g++)
		number[g] = -1;
	for (size_t i = 0; i < n; i++) {
		if (number[groups[i]] < 0)
			number[groups[i]] = next++;
		unit[i] = number[groups[i]];
	}
	free(number);
	return next;
}

/* Hold out the pairs whose element (group, or the pair itself) falls into fold f. */
static int fill_fold(struct incise_folds *folds, int f, const struct incise_pairs *pairs,
		     const size_t *place, const int *unit, bool grouped)
{
	size_t width = pairs->n_inputs + 1, n_fit = 0, n_held = 0;
	/* Weights follow the rows. */
	double *fit = malloc(pairs->n * (width + 1) * sizeof(*fit));
	double *held = malloc(pairs->n * (width + 1) * sizeof(*held));

	folds->fit[f].rows = fit;
	folds->held[f].rows = held;
	folds->unit[f] = malloc(pairs->n * sizeof(*unit));
	if (!fit || !held || !folds->unit[f])
		return -ENOMEM;
	for (size_t i = 0; i < pairs->n; i++) {
		const double *row = pairs->rows + width * i;

		if (place[grouped ? (size_t)unit[i] : i] % folds->n != (size_t)f) {
			fit[width * pairs->n + n_fit] = incise_pairs_weight(pairs, i);
			memcpy(fit + width * n_fit++, row, width * sizeof(*row));
			continue;
		}
		folds->unit[f][n_held] = grouped ? unit[i] : (int)i;
		held[width * pairs->n + n_held] = incise_pairs_weight(pairs, i);
		memcpy(held + width * n_held++, row, width * sizeof(*row));
	}
	folds->fit[f] = (struct incise_pairs){fit, n_fit, pairs->n_inputs,
					      fit + width * pairs->n};
	folds->held[f] = (struct incise_pairs){held, n_held, pairs->n_inputs,
					       held + width * pairs->n};
	folds->n_held += n_held;
	return 0;
}

int incise_folds_init(struct incise_folds *folds, const struct incise_pairs *pairs,
		      const int *groups, uint64_t seed)
{
	int *unit = malloc(pairs->n * sizeof(*unit));
	size_t *place = malloc(pairs->n * sizeof(*place));
	int n_groups = 0, rc = unit && place ? 0 : -ENOMEM;
	size_t elements = pairs->n;

	memset(folds, 0, sizeof(*folds));
	if (!rc && groups) {
		n_groups = count_groups(groups, pairs->n, unit);
		rc = n_groups < 0 ? n_groups : 0;
	}
	if (n_groups >= 2)
		elements = n_groups;
	folds->n = elements < CROSSVAL_FOLDS ? (int)elements : CROSSVAL_FOLDS;
	if (!rc)
		incise_random_shuffle(place, elements, seed);
	for (int f = 0; f < folds->n && !rc; f++)
		rc = fill_fold(folds, f, pairs, place, unit, n_groups >= 2);
	folds->n_units = (int)elements;
	free(unit);
	free(place);
	return rc;
}

void incise_folds_free(struct incise_folds *folds)
{
	for (int f = 0; f < CROSSVAL_FOLDS; f++) {
		free((void *)folds->fit[f].rows);
		free((void *)folds->held[f].rows);
		free(folds->unit[f]);
	}
}

/* Fits without each fold. */
struct fits {
	const struct incise_basis *basis;
	const struct incise_folds *folds;
	struct incise_lsq *lsq; /* of the pairs outside a fold */
	double *x, *phi;	/* a solution; a row */
	int n;
};

static int fits_init(struct fits *fits, const struct incise_basis *basis,
		     const struct incise_folds *folds)
{
	int n = basis->n_rules * (basis->n_inputs + 1);

	*fits = (struct fits){basis,
			      folds,
			      incise_lsq_new(n, folds->watch),
			      malloc(n * sizeof(double)),
			      malloc(n * sizeof(double)),
			      n};
	return fits->lsq && fits->x && fits->phi ? 0 : -ENOMEM;
}

static void fits_free(struct fits *fits)
{
	incise_lsq_free(fits->lsq);
	free(fits->x);
	free(fits->phi);
}

static int fold_others(struct fits *fits, int f)
{
	incise_basis_fold(fits->basis, &fits->folds->fit[f], fits->lsq);
	return incise_watch_count(fits->folds->watch, 0) ? -ECANCELED : 0;
}

/* Add the squared errors of fold f's held pairs. */
static void add_errors(const struct fits *fits, int f, double *error)
{
	const struct incise_pairs *held = &fits->folds->held[f];

	for (size_t i = 0; i < held->n; i++) {
		const double *x = held->rows + i * (held->n_inputs + 1);
		double e = incise_basis_error(fits->basis, x, fits->x);

		error[fits->folds->unit[f][i]] += incise_pairs_weight(held, i) * e * e;
	}
}

int incise_crossval_ridges(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridges, int n, double *error)
{
	struct fits fits;
	int rc = fits_init(&fits, basis, folds);

	memset(error, 0, (size_t)n * folds->n_units * sizeof(*error));
	for (int f = 0; f < folds->n && !rc; f++) {
		rc = fold_others(&fits, f);
		for (int i = 0; i < n && !rc; i++) {
			rc = incise_lsq_solve(fits.lsq, &ridges[i], fits.x);
			if (!rc)
				add_errors(&fits, f, error + (size_t)i * folds->n_units);
		}
	}
	fits_free(&fits);
	return rc;
}

static int add_ratios(struct fits *fits, int f, const struct incise_ridge *ridge,
		      double *ratios)
{
	const struct incise_pairs *held = &fits->folds->held[f];
	double w[INCISE_MODEL_RULES_MAX];
	int stride, rc;
	const double *factor = incise_lsq_factor(fits->lsq, ridge, &stride);

	rc = factor ? incise_lsq_back(factor, stride, fits->n, fits->n, fits->x) : -errno;
	if (rc)
		return rc;
	for (size_t i = 0;
	     i < held->n && !incise_watch_count(fits->folds->watch, pow(fits->n, 2));
	     i++) {
		const double *x = held->rows + i * (held->n_inputs + 1);

		incise_basis_firing(fits->basis, x, w);
		incise_basis_row(fits->basis, w, x, fits->phi);
		ratios[i] =
			incise_basis_error(fits->basis, x, fits->x) /
			sqrt(1 + incise_lsq_leverage(factor, stride, fits->n, fits->phi));
	}
	return incise_watch_count(fits->folds->watch, 0) ? -ECANCELED : 0;
}

int incise_crossval_ratios(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridge, double *ratios)
{
	struct fits fits;
	int rc = fits_init(&fits, basis, folds);

	for (int f = 0; f < folds->n && !rc; f++) {
		rc = fold_others(&fits, f);
		if (!rc)
			rc = add_ratios(&fits, f, ridge, ratios);
		ratios += folds->held[f].n;
	}
	fits_free(&fits);
	return rc;
}

/* --- the ridge --- */

/* The mean of the rules' consequents, a plane, is held down just enough to be defined. */
#define PLANE 1e-3

/* So strong that rules do not differ. */
#define RIGID 1e5

/* The pull towards the quadratic law, against that of many pairs; weaker ones, 1 and 10, are towards its products too. */
#define PULL 100
#define PULLS 2

void incise_crossval_settings(const struct incise_basis *basis,
			      struct incise_ridge *ridges)
{
	for (int i = 0; i < CROSSVAL_RIDGES; i++) {
		ridges[i] = (struct incise_ridge){
			.ridge = fmin(1e-3 * pow(10, i), RIGID),
			.mean = i == CROSSVAL_RIDGES - 1 ? RIGID : PLANE,
			.n = basis->n_rules * (basis->n_inputs + 1),
		};
		memcpy(ridges[i].n_mfs, basis->n_mfs, sizeof(ridges[i].n_mfs));
	}
}

/* Totals in the order of the settings. The last is the quadratic, which may be worse by a standard error. */
static void choose_setting(const struct incise_folds *folds,
			   const struct incise_ridge *ridges, int n,
			   struct incise_choice *choice)
{
	const double *error = choice->error, *kept = error;

	for (int i = 0; i < n; i++, error += folds->n_units) {
		double total = incise_crossval_total(folds, error), clear = 0;

		if (i == CROSSVAL_RIDGES - 2)
			choice->plane = total;
		else if (i == CROSSVAL_RIDGES - 1)
			choice->mean = total;
		if (i == CROSSVAL_RIDGES + PULLS) {
			choice->quadratic = total;
			clear = incise_crossval_spread(folds->n_units, error, kept);
		}
		if (total >= choice->total + clear)
			continue;
		choice->ridge = ridges[i];
		choice->total = total;
		kept = error;
	}
	memmove(choice->error, kept, folds->n_units * sizeof(*kept));
}

int incise_crossval_choose(const struct incise_basis *basis,
			   const struct incise_folds *folds, const double *quadratic,
			   struct incise_choice *choice)
{
	struct incise_ridge ridges[CROSSVAL_RIDGES + PULLS + 1];
	int d = basis->n_inputs, n = CROSSVAL_RIDGES + (quadratic ? PULLS + 1 : 0), rc;
	double *error = malloc((size_t)n * folds->n_units * sizeof(*error));

	if (!error)
		return -ENOMEM;
	incise_crossval_settings(basis, ridges);
	for (int i = 0; i <= PULLS; i++)
		ridges[CROSSVAL_RIDGES + i] =
			(struct incise_ridge){.ridge = i < PULLS ? pow(10, i) : PULL,
					      .n = basis->n_rules * (d + 1),
					      .free = quadratic,
					      .n_free = i < PULLS ? 2 * d : d + 1};
	rc = incise_crossval_ridges(basis, folds, ridges, n, error);
	*choice = (struct incise_choice){.error = error,
					 .total = HUGE_VAL,
					 .n_units = folds->n_units,
					 .quadratic = NAN};
	if (rc)
		free(error);
	else
		choose_setting(folds, ridges, n, choice);
	return rc;
}

double incise_crossval_total(const struct incise_folds *folds, const double *error)
{
	double sum = 0;

	for (int u = 0; u < folds->n_units; u++)
		sum += error[u];
	return sum;
}

double incise_crossval_spread(int n, const double *a, const double *b)
{
	double mean = 0, sum = 0;

	if (n < 2)
		return 0;
	for (int u = 0; u < n; u++)
		mean += (a[u] - b[u]) / n;
	for (int u = 0; u < n; u++)
		sum += pow(a[u] - b[u] - mean, 2);
	return sqrt(sum * n / (n - 1));
}
