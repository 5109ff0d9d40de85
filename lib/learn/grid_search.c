// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The model that training starts from, and how many membership functions each of its inputs
 * should have; see incise/train.h.
 *
 * The held-out error of an even grid at its best ridge is cheap, so a grid is judged by
 * it; the premises are searched later, for the grid chosen. All grids visited stay in the
 * race: growing goes on past one that is no better, because two more functions may be.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "pairs.h"
#include "tune.h"

/* Functions of an input, at most: more would need data of a kind that cuts do not give. */
#define MFS_MAX 6

/* Rounds of growth without a better grid before it ends. */
#define PATIENCE 3

/* Share of the squared error that is no matter: half a percent of the RMSE. */
#define ALIKE 0.01

/* Pairs per consequent parameter, at least. */
#define PAIRS_PER_PARAMETER 2

/* Pairs that judge a grid; see TUNED_MAX in train.c. */
#define SAMPLE_MAX 3000

#define VISITED_MAX \
	(1 + INCISE_MODEL_INPUTS_MAX * (MFS_MAX - 1) * INCISE_MODEL_INPUTS_MAX)

struct grid_search_grid {
	int n_mfs[INCISE_MODEL_INPUTS_MAX], rules;
	double total;
	double *error; /* by unit */
};

struct race {
	int n_inputs;
	const struct incise_variable *inputs;
	enum incise_mf_type type;
	struct incise_scaling scaling;
	struct incise_sample sample;
	struct incise_folds folds;
	struct incise_watch watch;
	double *errors; /* ridges × units */
	struct grid_search_grid visited[VISITED_MAX];
	int n;
};

static int count_rules(const int *n_mfs, int n)
{
	int rules = 1;

	for (int i = 0; i < n && rules <= INCISE_MODEL_RULES_MAX; i++)
		rules *= n_mfs[i];
	return rules;
}

static bool allowed(const struct race *race, const int *n_mfs, size_t n_pairs)
{
	int rules = count_rules(n_mfs, race->n_inputs);

	for (int i = 0; i < race->n_inputs; i++)
		if (n_mfs[i] > MFS_MAX)
			return false;
	return race->n < VISITED_MAX && rules <= INCISE_MODEL_RULES_MAX &&
	       (size_t)PAIRS_PER_PARAMETER * rules * (race->n_inputs + 1) <= n_pairs;
}

/* Judge a grid by its held-out squared errors at the best ridge. */
static int visit(struct race *race, const int *n_mfs)
{
	static const struct incise_variable output = {"", 0, 1};
	struct incise_model *model = incise_model_new_grid(
		race->n_inputs, race->inputs, n_mfs, race->type, &output, NULL);
	struct grid_search_grid *grid = &race->visited[race->n];
	struct incise_ridge ridges[TUNE_RIDGES];
	struct incise_basis basis;
	int rc = model ? incise_basis_init(&basis, model) : -errno;

	incise_model_free(model);
	if (rc)
		return rc;
	incise_scaling_premises(&race->scaling, &basis, false);
	incise_tune_ridges(&basis, ridges);
	rc = incise_crossval_ridges(&basis, &race->folds, ridges, TUNE_RIDGES,
				    race->errors);
	if (rc)
		return rc;
	grid->error = malloc(race->folds.n_units * sizeof(double));
	if (!grid->error)
		return -ENOMEM;
	race->n++;
	memcpy(grid->n_mfs, n_mfs, race->n_inputs * sizeof(*n_mfs));
	grid->rules = basis.n_rules;
	grid->total = HUGE_VAL;
	for (int i = 0; i < TUNE_RIDGES; i++) {
		const double *error = race->errors + (size_t)i * race->folds.n_units;
		double total = incise_crossval_total(&race->folds, error);

		if (total >= grid->total)
			continue;
		grid->total = total;
		memcpy(grid->error, error, race->folds.n_units * sizeof(double));
	}
	return 0;
}

/* Grow the input that gains most, until growth has not paid for some rounds. */
static int grow_grid_search(struct race *race, int *at, size_t n_pairs)
{
	double least = HUGE_VAL;
	int rc = 0;

	for (int idle = 0; idle < PATIENCE && !rc;) {
		int next = -1;

		for (int i = 0; i < race->n_inputs && !rc; i++) {
			int first = race->n;

			at[i]++;
			if (allowed(race, at, n_pairs))
				rc = visit(race, at);
			at[i]--;
			if (race->n > first &&
			    (next < 0 ||
			     race->visited[first].total < race->visited[next].total))
				next = first;
		}
		if (rc || next < 0)
			break;
		idle = race->visited[next].total < least ? 0 : idle + 1;
		least = fmin(least, race->visited[next].total);
		memcpy(at, race->visited[next].n_mfs, race->n_inputs * sizeof(*at));
	}
	return rc;
}

/*
 * The fewest rules within a standard error of the best, or as good as alike; of as many
 * rules, the best.
 */
static const struct grid_search_grid *winner(const struct race *race)
{
	const struct grid_search_grid *best = &race->visited[0], *chosen;

	for (int i = 1; i < race->n; i++)
		if (race->visited[i].total < best->total)
			best = &race->visited[i];
	chosen = best;
	for (int i = 0; i < race->n; i++) {
		const struct grid_search_grid *grid = &race->visited[i];
		double spread =
			incise_crossval_spread(&race->folds, grid->error, best->error);

		if (grid->total - best->total <= fmax(spread, ALIKE * best->total) &&
		    (grid->rules < chosen->rules ||
		     (grid->rules == chosen->rules && grid->total < chosen->total)))
			chosen = grid;
	}
	return chosen;
}

static int run_grid_search(struct race *race, const struct incise_pairs *pairs,
			   const struct incise_train_options *options, int *n_mfs)
{
	int at[INCISE_MODEL_INPUTS_MAX] = {0}, rc;

	incise_scaling_find(&race->scaling, race->inputs, pairs);
	rc = incise_sample_take(&race->sample, &race->scaling, pairs, options->groups,
				SAMPLE_MAX, options->seed);
	if (!rc)
		rc = incise_folds_init(&race->folds, &race->sample.pairs,
				       race->sample.groups, options->seed);
	race->folds.watch = &race->watch;
	if (rc)
		return rc;
	race->errors =
		malloc((size_t)TUNE_RIDGES * race->folds.n_units * sizeof(*race->errors));
	if (!race->errors)
		return -ENOMEM;
	for (int i = 0; i < race->n_inputs; i++)
		at[i] = 1;
	if (!allowed(race, at, race->sample.pairs.n))
		return -ENODATA;
	rc = visit(race, at);
	if (!rc)
		rc = grow_grid_search(race, at, race->sample.pairs.n);
	if (!rc)
		memcpy(n_mfs, winner(race)->n_mfs, race->n_inputs * sizeof(*n_mfs));
	return rc;
}

int incise_choose_grid(const struct incise_pairs *pairs,
		       const struct incise_variable *inputs, enum incise_mf_type type,
		       const struct incise_train_options *options, int *n_mfs,
		       struct incise_error *err)
{
	struct race *race;
	int rc;

	if (pairs->n_inputs < 1 || pairs->n_inputs > INCISE_MODEL_INPUTS_MAX)
		return incise_error_set(err, EINVAL, "%d inputs: a model has 1 to %d",
					pairs->n_inputs, INCISE_MODEL_INPUTS_MAX);
	rc = incise_pairs_check(pairs, "training", err);
	if (!rc)
		rc = incise_pairs_check_inputs(pairs, inputs, err);
	if (rc)
		return rc;
	race = calloc(1, sizeof(*race));
	if (!race)
		return incise_error_set(err, ENOMEM, "no memory to compare grids");
	race->n_inputs = pairs->n_inputs;
	race->inputs = inputs;
	race->type = type;
	race->watch = incise_watch_of(options);
	if (!incise_watch_ask(&race->watch))
		rc = run_grid_search(race, pairs, options, n_mfs);
	if (race->watch.stopped)
		rc = -ECANCELED;
	for (int i = 0; i < race->n; i++)
		free(race->visited[i].error);
	incise_folds_free(&race->folds);
	incise_sample_free(&race->sample);
	free(race->errors);
	free(race);
	if (!rc)
		return 0;
	if (rc == -ECANCELED)
		return incise_error_set(err, ECANCELED, "training was stopped");
	return incise_error_set(
		err, -rc,
		rc == -ENODATA	? "%zu training pairs are too few to select numbers of "
				  "membership functions; give --mf or more data"
		: rc == -ENOMEM ? "no memory to compare grids over %zu pairs"
				: "no grid can be fitted to these %zu pairs: their "
				  "values are too extreme; scale them",
		pairs->n);
}

/* Range of a column over the training pairs: unseen ones shape nothing. */
static struct incise_variable find_variable(const struct incise_pairs *pairs, int column,
					    const char *name)
{
	size_t width = pairs->n_inputs + 1;
	struct incise_variable v = {
		.min = pairs->rows[column],
		.max = pairs->rows[column],
	};

	snprintf(v.name, sizeof(v.name), "%s", name);
	for (size_t i = 1; i < pairs->n; i++) {
		v.min = fmin(v.min, pairs->rows[i * width + column]);
		v.max = fmax(v.max, pairs->rows[i * width + column]);
	}
	return v;
}

struct incise_model *incise_train_start(const struct incise_pairs *pairs,
					const char *const *names,
					enum incise_mf_type type, int *n_mfs,
					const struct incise_train_options *options,
					struct incise_error *err)
{
	struct incise_variable in[INCISE_MODEL_INPUTS_MAX], out;
	int n = pairs->n_inputs;

	for (int i = 0; i < n; i++)
		in[i] = find_variable(pairs, i, names[i]);
	out = find_variable(pairs, n, names[n]);
	for (int i = 0; i <= n && options->ranges; i++) {
		struct incise_variable *v = i < n ? &in[i] : &out;

		v->min = options->ranges[i].min;
		v->max = options->ranges[i].max;
	}
	if (!isfinite(out.max - out.min))
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"column %s spans %g to %g, too wide for a double; scale it",
			out.name, out.min, out.max);
	if (!(out.min < out.max))
		out.max = out.min + fmax(fabs(out.min), 1) * 1e-6;
	if (!*n_mfs && incise_choose_grid(pairs, in, type, options, n_mfs, err))
		return NULL;
	return incise_model_new_grid(n, in, n_mfs, type, &out, err);
}
