// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training pairs; see pairs.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "crossval.h"
#include "pairs.h"
#include "shuffle.h"

/* A pair for each fold; fewer say nothing. */
#define PAIRS_MIN CROSSVAL_FOLDS

int incise_pairs_check(const struct incise_pairs *pairs, const char *what,
		       struct incise_error *err)
{
	int width = pairs->n_inputs + 1;

	if (!pairs->n)
		return incise_error_set(err, EINVAL, "there are no %s pairs", what);
	for (size_t i = 0; i < pairs->n * width; i++)
		if (!isfinite(pairs->rows[i]))
			return incise_error_set(err, EINVAL, "%s pair %zu is not finite",
						what, i / width + 1);
	return 0;
}

int incise_pairs_check_inputs(const struct incise_pairs *pairs,
			      const struct incise_variable *inputs,
			      struct incise_error *err)
{
	int width = pairs->n_inputs + 1;

	if (pairs->n < PAIRS_MIN)
		return incise_error_set(
			err, ENODATA,
			"%zu training pairs are too few to learn from: at least %d",
			pairs->n, PAIRS_MIN);
	for (int i = 0; i < pairs->n_inputs; i++) {
		size_t n = 1;

		while (n < pairs->n && pairs->rows[n * width + i] == pairs->rows[i])
			n++;
		if (n == pairs->n)
			return incise_error_set(
				err, EINVAL,
				"input %s is constant, %g, in all %zu training pairs: "
				"leave it out or record more",
				inputs[i].name, pairs->rows[i], pairs->n);
	}
	return 0;
}

/* Mark `most` of n by chance; NULL with errno ENOMEM. */
static bool *choose(size_t n, size_t most, uint64_t seed)
{
	size_t *order = malloc(n * sizeof(*order));
	bool *chosen = calloc(n, sizeof(*chosen));

	if (order && chosen) {
		incise_shuffle(order, n, seed);
		for (size_t i = 0; i < most; i++)
			chosen[order[i]] = true;
	} else {
		free(chosen);
		chosen = NULL;
	}
	free(order);
	return chosen;
}

int incise_sample_take(struct incise_sample *sample, const struct incise_scaling *scaling,
		       const struct incise_pairs *pairs, const int *groups, size_t most,
		       uint64_t seed)
{
	size_t n = pairs->n, width = pairs->n_inputs + 1, taken = 0;
	bool *chosen = n > most ? choose(n, most, seed) : NULL;

	if (n > most && !chosen)
		return -ENOMEM;
	if (n < most)
		most = n;
	sample->rows = malloc(most * width * sizeof(double));
	sample->groups = groups ? malloc(most * sizeof(int)) : NULL;
	if (!sample->rows || (groups && !sample->groups)) {
		free(chosen);
		return -ENOMEM;
	}
	for (size_t i = 0; i < n; i++) {
		if (chosen && !chosen[i])
			continue;
		incise_scaling_row(scaling, pairs->rows + i * width,
				   sample->rows + taken * width);
		if (groups)
			sample->groups[taken] = groups[i];
		taken++;
	}
	sample->pairs = (struct incise_pairs){sample->rows, taken, pairs->n_inputs};
	free(chosen);
	return 0;
}

void incise_sample_free(struct incise_sample *sample)
{
	free(sample->rows);
	free(sample->groups);
}

double incise_pairs_r2(const struct incise_pairs *pairs, double rmse)
{
	double mean = 0, sum = 0, largest = rmse;
	int width = pairs->n_inputs + 1;
	const double *y = pairs->rows + pairs->n_inputs;

	/* Relative to the largest, so that squares neither vanish nor overflow. */
	for (size_t i = 0; i < pairs->n; i++)
		largest = fmax(largest, fabs(y[i * width]));
	if (!(largest > 0))
		return NAN;
	for (size_t i = 0; i < pairs->n; i++)
		mean += y[i * width] / largest / pairs->n;
	for (size_t i = 0; i < pairs->n; i++)
		sum += pow(y[i * width] / largest - mean, 2) / pairs->n;
	/* What rounding leaves of a constant is no spread. */
	return sum > 1e-28 ? 1 - pow(rmse / largest, 2) / sum : NAN;
}
