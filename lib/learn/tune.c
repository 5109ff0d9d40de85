// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Choosing ridge, start and epochs; see tune.h.
 *
 *   ridge and average of the first premises ─▶ search with the ridge and its neighbours
 *                                                            └─▶ other starts
 *
 * The setting that moves the premises less is kept unless the other's
 * held-out error is clearly less: held-out errors of many settings have a winner by chance.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "interval.h"
#include "tune.h"

static const double sizes[TUNE_SIZES] = {1e-5, 1e-4, 1e-3, 1e-2, 1e-1,
					 1,    10,   100,  1e3,	 1e4};

/*
 * Held down fully, a large ridge leads to the mean of the output. Hardly, it leads to a
 * plane: rules differ only where the data insist. (Not 0: a plane may be undefined.)
 */
static const double means[TUNE_MEANS] = {1, 1e-3};

/* The ridge without cross-validation; good on real tissue data. */
#define DEFAULT_RIDGE 1.0

/* Epochs of a search in cross-validation, at most. */
#define EPOCHS_MAX 15

/* Multiplications that all searches may cost together: some ten seconds at most. */
#define BUDGET 1e11

/*
 * Standard errors by which a search has to win against one ridge. Against the average, it has to
 * be beyond chance: one search of many that wins by less has been worse on unseen cuts.
 */
#define CLEAR 1.0

struct tuner {
	const struct incise_folds *folds;
	int epochs;
	double *error; /* epochs × units, of the search at hand */
	double *best;  /* units, of the setting kept */
	double best_total;
	double clear; /* standard errors by which another setting has to win */
	struct incise_tuning *tuning;
};

static int try_search(struct tuner *t, const struct incise_basis *basis, int start,
		      const struct incise_ridge *ridge)
{
	int rc =
		incise_crossval_search(basis, t->folds, ridge, t->epochs, t->error, NULL);

	for (int e = 0; e < t->epochs && !rc; e++) {
		const double *error = t->error + (size_t)e * t->folds->n_units;
		double total = incise_crossval_total(t->folds, error);

		if (total >= t->best_total - t->clear * incise_crossval_spread(
								t->folds, error, t->best))
			continue;
		t->best_total = total;
		memcpy(t->best, error, t->folds->n_units * sizeof(*error));
		t->tuning->ridge = *ridge;
		t->tuning->start = start;
		t->tuning->epochs = e + 1;
		t->tuning->basis = *basis;
		incise_average_free(t->tuning->average);
		t->tuning->average = NULL;
		t->clear = CLEAR;
	}
	return rc;
}

void incise_tune_ridges(const struct incise_basis *basis, struct incise_ridge *ridges)
{
	for (int i = 0; i < TUNE_RIDGES; i++)
		ridges[i] = (struct incise_ridge){
			.ridge = sizes[i % TUNE_SIZES],
			.mean = means[i / TUNE_SIZES],
			.n = basis->n_rules * (basis->n_inputs + 1),
			.blocks = basis->n_rules,
		};
}

/* The ridge with the least held-out error at the premises given. */
static int choose_ridge(struct tuner *t, const struct incise_basis *basis,
			const struct incise_ridge *ridges, int *chosen)
{
	size_t size = (size_t)TUNE_RIDGES * t->folds->n_units;
	double *error = malloc(size * sizeof(*error));
	int rc = error ? incise_crossval_ridges(basis, t->folds, ridges, TUNE_RIDGES,
						error)
		       : -ENOMEM;

	*chosen = -1;
	for (int i = 0; i < TUNE_RIDGES && !rc; i++) {
		double total = incise_crossval_total(
			t->folds, error + (size_t)i * t->folds->n_units);

		if (*chosen >= 0 && total >= t->best_total)
			continue;
		*chosen = i;
		t->best_total = total;
		memcpy(t->best, error + (size_t)i * t->folds->n_units,
		       t->folds->n_units * sizeof(*error));
	}
	if (!rc)
		t->tuning->ridge = ridges[*chosen];
	free(error);
	return rc;
}

/* The average of ridges at the premises given, which a search then has to beat. */
static int choose_average(struct tuner *t, const struct incise_basis *basis)
{
	double *error = malloc(t->folds->n_units * sizeof(*error));
	int rc = error ? incise_average_find(&t->tuning->average, basis, t->folds, error)
		       : -ENOMEM;

	if (!rc) {
		t->clear = incise_student(t->folds->n_units - 1);
		t->best_total = incise_crossval_total(t->folds, error);
		memcpy(t->best, error, t->folds->n_units * sizeof(*error));
	}
	free(error);
	/* Where there is no average, the ridge stays. */
	return rc == -E2BIG || rc == -EDOM ? 0 : rc;
}

/* Multiplications of one epoch in all folds. */
static double cost(const struct incise_basis *basis, const struct incise_folds *folds)
{
	double n = basis->n_rules * (basis->n_inputs + 1), m = n + basis->n_premises;

	double rows = 0;

	for (int f = 0; f < folds->n; f++)
		rows += folds->fit[f].n;
	return 2 * rows * (n * n + m * m);
}

static int search_all(struct tuner *t, const struct incise_basis *basis,
		      const struct incise_ridge *ridges, int chosen, int starts,
		      uint64_t seed)
{
	struct incise_ridge ridge = t->tuning->ridge;
	int rc = try_search(t, basis, 0, &ridge);

	/* The neighbours in size. */
	for (int i = chosen - 1; i <= chosen + 1 && !rc && chosen >= 0; i += 2)
		if (i >= 0 && i < TUNE_RIDGES && i / TUNE_SIZES == chosen / TUNE_SIZES)
			rc = try_search(t, basis, 0, &ridges[i]);
	ridge = t->tuning->ridge;
	for (int start = 1; start < starts && !rc; start++) {
		struct incise_basis other = *basis;

		incise_premises_jitter(&other, seed * 1000003 + start);
		rc = try_search(t, &other, start, &ridge);
	}
	return rc;
}

int incise_tune(const struct incise_basis *basis, const struct incise_folds *folds,
		const struct incise_train_options *options, struct incise_tuning *tuning)
{
	struct tuner t = {
		.folds = folds, .best_total = HUGE_VAL, .clear = CLEAR, .tuning = tuning};
	struct incise_ridge ridges[TUNE_RIDGES];
	struct incise_basis first = *basis;
	int rc = -ENOMEM, chosen = -1, starts = options->starts;
	/* A larger sample may take more time. */
	double patience =
		options->tuned ? fmax(1, folds->n_held / (double)TUNED_PAIRS) : 1;
	double epochs = patience * BUDGET / cost(basis, folds);

	incise_tune_ridges(basis, ridges);
	*tuning = (struct incise_tuning){.ridge = ridges[0], .epochs = 1, .rmse = NAN};
	tuning->ridge.ridge = isnan(options->ridge) ? DEFAULT_RIDGE : options->ridge;
	incise_premises_project(&first);
	tuning->basis = first;
	if (folds->n < 2)
		return 0;
	t.epochs = options->epochs < EPOCHS_MAX ? options->epochs : EPOCHS_MAX;
	/* If all would take too long, other starts are left out first. */
	if (epochs < (starts + 2.0) * t.epochs)
		starts = 1;
	if (epochs < 3.0 * t.epochs)
		t.epochs = fmax(1, epochs / 3);
	t.error = malloc((size_t)t.epochs * folds->n_units * sizeof(*t.error));
	t.best = calloc(folds->n_units, sizeof(*t.best));
	if (!t.error || !t.best)
		goto out;
	rc = 0;
	if (isnan(options->ridge))
		rc = choose_ridge(&t, &first, ridges, &chosen);
	if (!rc && isnan(options->ridge))
		rc = choose_average(&t, &first);
	if (!rc)
		rc = search_all(&t, &first, ridges, chosen, starts, options->seed);
	if (!rc)
		tuning->rmse = sqrt(t.best_total / folds->n_held);
out:
	if (rc) {
		incise_average_free(tuning->average);
		tuning->average = NULL;
	}
	free(t.error);
	free(t.best);
	return rc;
}
