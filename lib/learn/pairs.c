// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training pairs; see pairs.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <incise/train.h>
#include "../base/random.h"
#include "crossval.h"
#include "pairs.h"

/* --- units --- */

/*
 * Variance of the output and its mean, relative to the largest output or *largest, so that
 * squares neither vanish nor overflow. 0 for a constant, whatever rounding leaves of it.
 */
static double output_variance(const struct incise_pairs *pairs, double *largest,
			      double *mean)
{
	const double *y = pairs->rows + pairs->n_inputs;
	int width = pairs->n_inputs + 1;
	double sum = 0;

	for (size_t i = 0; i < pairs->n; i++)
		*largest = fmax(*largest, fabs(y[i * width]));
	if (!(*largest > 0))
		*largest = 1;
	*mean = 0;
	for (size_t i = 0; i < pairs->n; i++)
		*mean += y[i * width] / *largest / pairs->n;
	for (size_t i = 0; i < pairs->n; i++)
		sum += pow(y[i * width] / *largest - *mean, 2) / pairs->n;
	return sum > 1e-28 ? sum : 0;
}

void incise_scaling_find(struct incise_scaling *scaling,
			 const struct incise_variable *inputs,
			 const struct incise_pairs *pairs)
{
	int d = pairs->n_inputs;
	double mean, variance, largest = 0;

	scaling->n_inputs = d;
	for (int i = 0; i < d; i++) {
		scaling->offset[i] = inputs[i].min;
		scaling->scale[i] = inputs[i].max - inputs[i].min;
	}
	variance = output_variance(pairs, &largest, &mean);
	scaling->offset[d] = mean * largest;
	scaling->scale[d] = variance > 0 ? sqrt(variance) * largest : largest;
}

void incise_scaling_row(const struct incise_scaling *scaling, const double *raw,
			double *scaled)
{
	int d = scaling->n_inputs;

	for (int i = 0; i < d; i++)
		scaled[i] = fmax(
			0, fmin(1, (raw[i] - scaling->offset[i]) / scaling->scale[i]));
	scaled[d] = (raw[d] - scaling->offset[d]) / scaling->scale[d];
}

void incise_scaling_premises(const struct incise_scaling *scaling,
			     struct incise_basis *basis, bool to_raw)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			/* Width and centre of both kinds are lengths, a slope is not. */
			double *width = basis->p + basis->at[i][k];
			double *centre = basis->p + incise_basis_centre(basis, i, k);

			if (to_raw) {
				*width *= scaling->scale[i];
				*centre =
					scaling->offset[i] + *centre * scaling->scale[i];
			} else {
				*width /= scaling->scale[i];
				*centre = (*centre - scaling->offset[i]) /
					  scaling->scale[i];
			}
		}
}

int incise_scaling_consequents(const struct incise_scaling *scaling, int n_rules,
			       double *consequents)
{
	int d = scaling->n_inputs;

	for (int r = 0; r < n_rules; r++) {
		double *p = consequents + r * (d + 1);

		p[0] = scaling->offset[d] + p[0] * scaling->scale[d];
		for (int i = 0; i < d; i++) {
			p[i + 1] = p[i + 1] / scaling->scale[i] * scaling->scale[d];
			p[0] -= p[i + 1] * scaling->offset[i];
		}
		for (int i = 0; i <= d; i++)
			if (!isfinite(p[i]))
				return -EDOM;
	}
	return 0;
}

/* --- checks, samples and errors --- */

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
	for (size_t i = 0; i < pairs->n; i++)
		if (!(incise_pairs_weight(pairs, i) > 0 &&
		      isfinite(incise_pairs_weight(pairs, i))))
			return incise_error_set(err, EINVAL,
						"%s pair %zu: its weight is not above 0",
						what, i + 1);
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
			"%zu training pairs are too few; expected at least %d", pairs->n,
			PAIRS_MIN);
	for (int i = 0; i < pairs->n_inputs; i++) {
		size_t n = 1;

		while (n < pairs->n && pairs->rows[n * width + i] == pairs->rows[i])
			n++;
		if (n == pairs->n)
			return incise_error_set(
				err, EINVAL,
				"input %s is constant, %g, in all %zu training pairs; "
				"remove it or record more",
				inputs[i].name, pairs->rows[i], pairs->n);
	}
	return 0;
}

/* Mark `most` of n by chance; NULL with errno ENOMEM. */
static bool *choose_pairs(size_t n, size_t most, uint64_t seed)
{
	size_t *order = malloc(n * sizeof(*order));
	bool *chosen = calloc(n, sizeof(*chosen));

	if (order && chosen) {
		incise_random_shuffle(order, n, seed);
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
	bool *chosen = n > most ? choose_pairs(n, most, seed) : NULL;

	if (n > most && !chosen)
		return -ENOMEM;
	if (n < most)
		most = n;
	sample->rows = malloc(most * (width + 1) * sizeof(double)); /* and weights */
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
		sample->rows[most * width + taken] = incise_pairs_weight(pairs, i);
		if (groups)
			sample->groups[taken] = groups[i];
		taken++;
	}
	sample->pairs = (struct incise_pairs){sample->rows, taken, pairs->n_inputs,
					      sample->rows + most * width};
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
	double mean, largest = rmse, variance = output_variance(pairs, &largest, &mean);

	return variance > 0 ? 1 - pow(rmse / largest, 2) / variance : NAN;
}

double incise_pairs_rmse(const struct incise_model *model,
			 const struct incise_pairs *pairs, bool clamped)
{
	const struct incise_variable *range = incise_model_info(model)->input;
	double x[INCISE_MODEL_INPUTS_MAX];
	double w[INCISE_MODEL_RULES_MAX], sum = 0, largest = 0;
	struct incise_basis basis;
	/* A grid has a quicker way to them. */
	bool grid = !incise_basis_init(&basis, model);

	for (size_t n = 0; n < pairs->n; n++) {
		const double *row = pairs->rows + n * (pairs->n_inputs + 1);
		double e = -row[pairs->n_inputs];

		for (int i = 0; i < pairs->n_inputs; i++)
			x[i] = clamped ? fmax(range[i].min, fmin(range[i].max, row[i]))
				       : row[i];
		if (grid)
			incise_basis_firing(&basis, x, w);
		else
			incise_model_firing(model, x, w);
		for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
			const double *p = incise_model_rule(model, r)->p;

			e += w[r] * p[0];
			for (int i = 0; i < pairs->n_inputs; i++)
				e += w[r] * p[i + 1] * x[i];
		}
		/* Σe² as largest²·sum, which neither vanishes nor overflows. */
		e = fabs(e);
		if (e > largest) {
			sum *= (largest / e) * (largest / e);
			largest = e;
		}
		if (largest > 0)
			sum += (e / largest) * (e / largest);
	}
	return pairs->n ? largest * sqrt(sum / pairs->n) : NAN;
}

/* --- both sides of a split --- */

int incise_split_units(uint64_t *count, size_t n_units, double share, uint64_t seed,
		       const char *what, struct incise_error *err)
{
	size_t *order;
	uint64_t n = 0, taken = 0;

	if (!(share > 0 && share < 1))
		return incise_error_set(
			err, EINVAL,
			"the share of check data is %g: expected between 0 and 1", share);
	if (n_units < 2)
		return incise_error_set(
			err, EINVAL,
			"too few %s (%zu): at least two are required to hold out "
			"some for checking",
			what, n_units);
	order = malloc(n_units * sizeof(*order));
	if (!order)
		return incise_error_set(err, ENOMEM, "no memory to split %zu %s", n_units,
					what);
	for (size_t u = 0; u < n_units; u++)
		n += count[u];
	incise_random_shuffle(order, n_units, seed);
	/* Take units until the next one would lead further away from the share. */
	for (size_t u = 0; u + 1 < n_units; u++) {
		double with = fabs((double)(taken + count[order[u]]) - share * n);

		if (u && with >= fabs((double)taken - share * n))
			continue;
		taken += count[order[u]];
		count[order[u]] = 0; /* taken */
	}
	free(order);
	return 0;
}

int incise_split(size_t n, const int *groups, double share, uint64_t seed, bool *check,
		 struct incise_error *err)
{
	size_t n_units = n;
	uint64_t *count;
	int rc;

	if (groups) {
		n_units = 0;
		for (size_t i = 0; i < n; i++)
			if ((size_t)groups[i] + 1 > n_units)
				n_units = (size_t)groups[i] + 1;
	}
	count = calloc(n_units + 1, sizeof(*count));
	if (!count)
		return incise_error_set(err, ENOMEM, "no memory to split %zu rows", n);
	for (size_t i = 0; i < n; i++)
		count[groups ? (size_t)groups[i] : i]++;
	rc = incise_split_units(count, n_units, share, seed, groups ? "groups" : "rows",
				err);
	for (size_t i = 0; i < n && !rc; i++)
		check[i] = !count[groups ? (size_t)groups[i] : i];
	free(count);
	return rc;
}
