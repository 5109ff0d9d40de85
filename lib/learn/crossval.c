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
#include "varpro.h"

/* Up to so many pairs the division into folds is repeated. */
#define REPEATED_MAX 1000

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
static int fill_fold(struct incise_folds *folds, int at, const struct incise_pairs *pairs,
		     const size_t *place, const int *unit, bool grouped, int n_folds,
		     int f)
{
	size_t width = pairs->n_inputs + 1, n_fit = 0, n_held = 0;
	/* Weights follow the rows. */
	double *fit = malloc(pairs->n * (width + 1) * sizeof(*fit));
	double *held = malloc(pairs->n * (width + 1) * sizeof(*held));

	folds->fit[at].rows = fit;
	folds->held[at].rows = held;
	folds->unit[at] = malloc(pairs->n * sizeof(*unit));
	if (!fit || !held || !folds->unit[at])
		return -ENOMEM;
	for (size_t i = 0; i < pairs->n; i++) {
		const double *row = pairs->rows + width * i;

		if (place[grouped ? (size_t)unit[i] : i] % n_folds != (size_t)f) {
			fit[width * pairs->n + n_fit] = incise_pairs_weight(pairs, i);
			memcpy(fit + width * n_fit++, row, width * sizeof(*row));
			continue;
		}
		folds->unit[at][n_held] = grouped ? unit[i] : (int)i;
		held[width * pairs->n + n_held] = incise_pairs_weight(pairs, i);
		memcpy(held + width * n_held++, row, width * sizeof(*row));
	}
	folds->fit[at] = (struct incise_pairs){fit, n_fit, pairs->n_inputs,
					       fit + width * pairs->n};
	folds->held[at] = (struct incise_pairs){held, n_held, pairs->n_inputs,
						held + width * pairs->n};
	folds->n_held += n_held;
	return 0;
}

int incise_folds_init(struct incise_folds *folds, const struct incise_pairs *pairs,
		      const int *groups, uint64_t seed)
{
	int *unit = malloc(pairs->n * sizeof(*unit));
	size_t *place = malloc(pairs->n * sizeof(*place));
	int n_groups = 0, n_folds, repeats, rc = unit && place ? 0 : -ENOMEM;
	size_t elements = pairs->n;

	memset(folds, 0, sizeof(*folds));
	if (!rc && groups) {
		n_groups = count_groups(groups, pairs->n, unit);
		rc = n_groups < 0 ? n_groups : 0;
	}
	if (n_groups >= 2)
		elements = n_groups;
	n_folds = elements < CROSSVAL_FOLDS ? (int)elements : CROSSVAL_FOLDS;
	/* With no more elements than folds there is one division only. */
	repeats = elements > CROSSVAL_FOLDS && pairs->n <= REPEATED_MAX ? CROSSVAL_REPEATS
									: 1;
	for (int repeat = 0; repeat < repeats && !rc; repeat++) {
		incise_random_shuffle(place, elements, seed + repeat);
		for (int f = 0; f < n_folds && !rc; f++)
			rc = fill_fold(folds, folds->n++, pairs, place, unit,
				       n_groups >= 2, n_folds, f);
	}
	folds->n_units = (int)elements;
	folds->cuts = n_groups >= 2;
	free(unit);
	free(place);
	return rc;
}

void incise_folds_free(struct incise_folds *folds)
{
	for (int f = 0; f < CROSSVAL_MAX; f++) {
		free((void *)folds->fit[f].rows);
		free((void *)folds->held[f].rows);
		free(folds->unit[f]);
	}
}

/* Add the squared errors of fold f's held pairs. */
static void add_errors(const struct incise_folds *folds, int f,
		       const struct incise_basis *basis, const double *consequents,
		       double *error)
{
	const struct incise_pairs *held = &folds->held[f];

	for (size_t i = 0; i < held->n; i++) {
		const double *x = held->rows + i * (held->n_inputs + 1);
		double e = incise_basis_error(basis, x, consequents);

		error[folds->unit[f][i]] += incise_pairs_weight(held, i) * e * e;
	}
}

static int go_on(const struct incise_folds *folds)
{
	return incise_watch_count(folds->watch, 0) ? -ECANCELED : 0;
}

int incise_crossval_ridges(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridges, int n, double *error)
{
	int n_linear = basis->n_rules * (basis->n_inputs + 1);
	struct incise_lsq *lsq = incise_lsq_new(n_linear, folds->watch);
	double *x = malloc(n_linear * sizeof(*x));
	int rc = lsq && x ? 0 : -ENOMEM;

	memset(error, 0, (size_t)n * folds->n_units * sizeof(*error));
	for (int f = 0; f < folds->n && !rc; f++) {
		rc = go_on(folds);
		incise_basis_fold(basis, &folds->fit[f], lsq, NULL, 0);
		for (int i = 0; i < n && !rc; i++) {
			rc = incise_lsq_solve(lsq, &ridges[i], x);
			if (!rc)
				add_errors(folds, f, basis, x,
					   error + (size_t)i * folds->n_units);
		}
	}
	incise_lsq_free(lsq);
	free(x);
	return rc;
}

struct search {
	const struct incise_folds *folds;
	int fold;
	double *error;
};

static bool add_epoch(void *user, int epoch, const struct incise_basis *basis,
		      const double *consequents)
{
	struct search *s = user;

	add_errors(s->folds, s->fold, basis, consequents,
		   s->error + (size_t)(epoch - 1) * s->folds->n_units);
	return true;
}

/* The errors of fold f's units at an epoch, again at the later ones. */
static void repeat(const struct incise_folds *folds, int f, double *error, int epoch,
		   int epochs, bool *mine)
{
	memset(mine, 0, folds->n_units * sizeof(*mine));
	for (size_t i = 0; i < folds->held[f].n; i++)
		mine[folds->unit[f][i]] = true;
	for (int e = epoch; e < epochs; e++)
		for (int u = 0; u < folds->n_units; u++)
			if (mine[u])
				error[(size_t)e * folds->n_units + u] =
					error[(size_t)(epoch - 1) * folds->n_units + u];
}

static int find_ratios(const struct incise_folds *folds, int f,
		       const struct incise_basis *basis, const double *consequents,
		       const struct incise_ridge *ridge, double *ratios)
{
	const struct incise_pairs *held = &folds->held[f];
	double w[INCISE_MODEL_RULES_MAX];
	int d = held->n_inputs, n = basis->n_rules * (d + 1), stride, rc = -ENOMEM;
	struct incise_lsq *lsq = incise_lsq_new(n, folds->watch);
	double *phi = malloc(n * sizeof(*phi));
	const double *factor;

	if (!lsq || !phi)
		goto out;
	rc = -EDOM;
	incise_basis_fold(basis, &folds->fit[f], lsq, NULL, 0);
	factor = incise_lsq_factor(lsq, ridge, &stride);
	if (!factor)
		goto out;
	rc = 0;
	for (size_t i = 0;
	     i < held->n && !incise_watch_count(folds->watch, (double)n * n); i++) {
		const double *x = held->rows + i * (d + 1);
		double e = incise_basis_error(basis, x, consequents);

		incise_basis_firing(basis, x, w);
		incise_basis_row(basis, w, x, phi);
		ratios[i] = e / sqrt(1 + incise_lsq_leverage(factor, stride, n, phi));
	}
out:
	incise_lsq_free(lsq);
	free(phi);
	return rc;
}

int incise_crossval_search(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridge, int epochs, double *error,
			   double *ratios)
{
	int n = basis->n_rules * (basis->n_inputs + 1);
	double *consequents = malloc(n * sizeof(*consequents));
	bool *mine = malloc(folds->n_units * sizeof(*mine));
	int rc = consequents && mine ? 0 : -ENOMEM;

	memset(error, 0, (size_t)epochs * folds->n_units * sizeof(*error));
	for (int f = 0; f < folds->n && !rc; f++) {
		struct search search = {folds, f, error};
		struct incise_varpro varpro = {.pairs = &folds->fit[f],
					       .ridge = ridge,
					       .epochs = epochs,
					       .each = add_epoch,
					       .user = &search,
					       .watch = folds->watch};
		struct incise_basis trial = *basis;

		rc = go_on(folds);
		if (!rc)
			rc = incise_varpro_run(&trial, consequents, &varpro);
		if (rc)
			break;
		repeat(folds, f, error, varpro.run, epochs, mine);
		if (!ratios)
			continue;
		rc = find_ratios(folds, f, &trial, consequents, ridge, ratios);
		ratios += folds->held[f].n;
	}
	free(consequents);
	free(mine);
	return rc;
}

double incise_crossval_total(const struct incise_folds *folds, const double *error)
{
	double sum = 0;

	for (int u = 0; u < folds->n_units; u++)
		sum += error[u];
	return sum;
}

double incise_crossval_spread(const struct incise_folds *folds, const double *a,
			      const double *b)
{
	double mean = 0, sum = 0;
	int n = folds->n_units;

	if (n < 2)
		return 0;
	for (int u = 0; u < n; u++)
		mean += (a[u] - b[u]) / n;
	for (int u = 0; u < n; u++)
		sum += pow(a[u] - b[u] - mean, 2);
	return sqrt(sum * n / (n - 1));
}
