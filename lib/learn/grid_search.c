// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The model that training starts from, and how many membership functions each of its inputs
 * should have; see incise/train.h.
 *
 * A grid is judged by its held-out error at its best ridge. All grids visited stay in the
 * race: growing goes on past one that is no better, because two more functions may be.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "crossval.h"
#include "pairs.h"

/* Functions of an input, at most: more would need data of a kind that cuts do not give. */
#define MFS_MAX 6

/* Rounds of growth without a better grid before it ends. */
#define PATIENCE 3

/* Share of the squared error that is no matter: half a percent of the RMSE. */
#define ALIKE 0.01

/* Pairs per consequent parameter, at least. */
#define PAIRS_PER_PARAMETER 2

#define VISITED_MAX \
	(1 + INCISE_MODEL_INPUTS_MAX * (MFS_MAX - 1) * INCISE_MODEL_INPUTS_MAX)

struct grid_search_grid {
	int n_mfs[INCISE_MODEL_INPUTS_MAX], rules;
	double total;
	double *error; /* by unit */
};

struct race {
	int n_inputs;
	struct incise_variable inputs[INCISE_MODEL_INPUTS_MAX], output;
	enum incise_mf_type type;
	bool even; /* functions are not placed by the pairs */
	struct incise_scaling scaling;
	struct incise_sample sample;
	struct incise_folds folds;
	struct incise_watch watch;
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

/* A grid whose functions are placed, and its scaled premises. NULL with errno. */
static struct incise_model *make_grid(const struct race *race, const int *n_mfs,
				      struct incise_basis *basis,
				      struct incise_error *err)
{
	struct incise_model *model = incise_model_new_grid(
		race->n_inputs, race->inputs, n_mfs, race->type, &race->output, err);
	struct incise_basis raw;
	int rc = model ? incise_basis_init(basis, model) : -errno;

	if (rc)
		goto fail;
	incise_scaling_premises(&race->scaling, basis, false);
	if (race->even)
		return model;
	rc = incise_basis_place(basis, &race->sample.pairs);
	raw = *basis;
	incise_scaling_premises(&race->scaling, &raw, true);
	incise_basis_store(&raw, model);
fail:
	if (!rc)
		return model;
	incise_model_free(model);
	errno = -rc;
	return NULL;
}

/* Judge a grid by its held-out squared errors at the best ridge. */
static int visit(struct race *race, const int *n_mfs)
{
	struct grid_search_grid *grid = &race->visited[race->n];
	struct incise_choice choice;
	struct incise_basis basis;
	struct incise_model *model = make_grid(race, n_mfs, &basis, NULL);
	int rc = model ? incise_crossval_choose(&basis, &race->folds, NULL, &choice)
		       : -errno;

	incise_model_free(model);
	if (rc)
		return rc;
	race->n++;
	memcpy(grid->n_mfs, n_mfs, race->n_inputs * sizeof(*n_mfs));
	grid->rules = basis.n_rules;
	grid->total = choice.total;
	grid->error = choice.error;
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
		double spread = incise_crossval_spread(race->folds.n_units, grid->error,
						       best->error);

		if (grid->total - best->total <= fmax(spread, ALIKE * best->total) &&
		    (grid->rules < chosen->rules ||
		     (grid->rules == chosen->rules && grid->total < chosen->total)))
			chosen = grid;
	}
	return chosen;
}

static int run_grid_search(struct race *race, const struct incise_train_options *options,
			   int *n_mfs)
{
	const struct incise_pairs *pairs = &race->sample.pairs;
	int at[INCISE_MODEL_INPUTS_MAX] = {0};
	int rc = incise_folds_init(&race->folds, pairs, race->sample.groups,
				   options->seed);

	race->folds.watch = &race->watch;
	if (rc)
		return rc;
	for (int i = 0; i < race->n_inputs; i++)
		at[i] = 1;
	if (!allowed(race, at, pairs->n))
		return -ENODATA;
	rc = visit(race, at);
	if (!rc)
		rc = grow_grid_search(race, at, pairs->n);
	if (!rc)
		memcpy(n_mfs, winner(race)->n_mfs, race->n_inputs * sizeof(*n_mfs));
	return rc;
}

static int choose_grid(struct race *race, const struct incise_train_options *options,
		       int *n_mfs, struct incise_error *err)
{
	int rc = incise_watch_ask(&race->watch) ? 0
						: run_grid_search(race, options, n_mfs);

	if (race->watch.stopped)
		rc = -ECANCELED;
	for (int i = 0; i < race->n; i++)
		free(race->visited[i].error);
	incise_folds_free(&race->folds);
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
		race->sample.pairs.n);
}

/* --- ranges -------------------------------------------------------------------------- */

/* Share of the pairs beyond the quantiles that a range is found from, and its reach past them. */
#define TAIL 0.01
#define REACH 0.5

/* Range of a column over the training pairs: unseen ones shape nothing. NULL: no memory. */
static double *find_variable(struct incise_variable *v, const struct incise_pairs *pairs,
			     int column, const char *name)
{
	double *sorted = malloc(pairs->n * sizeof(*sorted));

	if (!sorted)
		return NULL;
	for (size_t i = 0; i < pairs->n; i++)
		sorted[i] = pairs->rows[i * (pairs->n_inputs + 1) + column];
	qsort(sorted, pairs->n, sizeof(*sorted), ascending);
	*v = (struct incise_variable){.min = sorted[0], .max = sorted[pairs->n - 1]};
	snprintf(v->name, sizeof(v->name), "%s", name);
	return sorted;
}

/*
 * The range of an input ends with the last pair before a far tail: a speed that was measured wrong
 * once does not spread the functions. Pairs outside are clamped, as inputs of a model are.
 */
static void cut_tails(struct incise_variable *v, const double *sorted, size_t n)
{
	size_t low = (size_t)(TAIL * (n - 1)), high = n - 1 - low;
	double reach = REACH * (sorted[high] - sorted[low]);
	double min = sorted[low] - reach, max = sorted[high] + reach;

	if (!(reach > 0))
		return;
	while (low > 0 && sorted[low - 1] >= min)
		low--;
	while (high < n - 1 && sorted[high + 1] <= max)
		high++;
	if (v->min < min)
		v->min = sorted[low];
	if (v->max > max)
		v->max = sorted[high];
}

/* Names and ranges of the columns: those of all pairs, if the options have them. */
static int find_variables(struct race *race, const struct incise_pairs *pairs,
			  const char *const *names,
			  const struct incise_train_options *options)
{
	for (int i = 0; i <= pairs->n_inputs; i++) {
		struct incise_variable *v =
			i < pairs->n_inputs ? &race->inputs[i] : &race->output;
		double *sorted = find_variable(v, pairs, i, names[i]);

		if (!sorted)
			return -ENOMEM;
		if (options->ranges) {
			v->min = options->ranges[i].min;
			v->max = options->ranges[i].max;
		}
		if (i < pairs->n_inputs && !race->even)
			cut_tails(v, sorted, pairs->n);
		free(sorted);
	}
	if (!(race->output.min < race->output.max))
		race->output.max =
			race->output.min + fmax(fabs(race->output.min), 1) * 1e-6;
	return 0;
}

/* --- the start ----------------------------------------------------------------------- */

static struct incise_model *start_race(struct race *race,
				       const struct incise_pairs *pairs,
				       const char *const *names, int *n_mfs,
				       const struct incise_train_options *options,
				       struct incise_error *err)
{
	const struct incise_variable *out = &race->output;
	struct incise_basis basis;
	int rc = find_variables(race, pairs, names, options);

	if (!rc && !isfinite(out->max - out->min))
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"column %s spans %g to %g, too wide for a double; scale it",
			out->name, out->min, out->max);
	if (!rc && !*n_mfs && incise_pairs_check_inputs(pairs, race->inputs, err))
		return NULL;
	if (!rc) {
		incise_scaling_find(&race->scaling, race->inputs, pairs);
		rc = incise_sample_take(&race->sample, &race->scaling, pairs,
					options->groups, TUNED_PAIRS, options->seed);
	}
	if (rc)
		return INCISE_ERROR_NULL(err, -rc, "no memory to place a grid");
	if (!*n_mfs && choose_grid(race, options, n_mfs, err))
		return NULL;
	return make_grid(race, n_mfs, &basis, err);
}

struct incise_model *incise_train_start(const struct incise_pairs *pairs,
					const char *const *names,
					enum incise_mf_type type, int *n_mfs,
					const struct incise_train_options *options,
					struct incise_error *err)
{
	struct incise_model *model = NULL;
	struct race *race;

	if (pairs->n_inputs < 1 || pairs->n_inputs > INCISE_MODEL_INPUTS_MAX)
		return INCISE_ERROR_NULL(err, EINVAL, "%d inputs: a model has 1 to %d",
					 pairs->n_inputs, INCISE_MODEL_INPUTS_MAX);
	if (incise_pairs_check(pairs, "training", err))
		return NULL;
	race = calloc(1, sizeof(*race));
	if (!race)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory to compare grids");
	race->n_inputs = pairs->n_inputs;
	race->type = type;
	race->even = options->classic;
	race->watch = incise_watch_of(options);
	model = start_race(race, pairs, names, n_mfs, options, err);
	incise_sample_free(&race->sample);
	free(race);
	return model;
}
