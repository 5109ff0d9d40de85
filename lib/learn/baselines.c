// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The predictors that a model must beat: the mean, linear regression and k nearest
 * neighbours; see incise/train.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "lsq.h"
#include "watch.h"
#include "../base/random.h"

static const int ks[] = {1, 3, 5, 10, 20, 50};
#define N_KS ((int)(sizeof(ks) / sizeof(*ks)))
#define K_MAX 50

/* Queries by which k is chosen: enough to distinguish ks, few enough to be quick. */
#define CHOOSERS 2000

/* Neighbours are looked for among so many pairs, for so many queries, at most: by chance
 * from more, where another neighbour would be no nearer than the noise. */
#define POOL_MAX 20000
#define QUERIES_MAX 5000

struct column {
	double mean, sd;
};

static void find_columns(const struct incise_pairs *pairs, struct column *columns)
{
	int width = pairs->n_inputs + 1;

	for (int c = 0; c < width; c++) {
		double mean = 0, sum = 0;

		for (size_t n = 0; n < pairs->n; n++)
			mean += pairs->rows[n * width + c] / pairs->n;
		for (size_t n = 0; n < pairs->n; n++) {
			double e = pairs->rows[n * width + c] - mean;

			sum += e * e / pairs->n;
		}
		columns[c] = (struct column){mean, sum > 0 ? sqrt(sum) : 1};
	}
}

static int linear_rmse(const struct incise_pairs *train, const struct incise_pairs *on,
		       const struct column *columns, double *rmse)
{
	int d = train->n_inputs;
	struct incise_lsq *lsq = incise_lsq_new(d + 1, NULL);
	/* Just enough ridge to be defined where inputs depend on each other. */
	struct incise_ridge ridge = {.ridge = 1e-9 * train->n, .n = d + 1};
	double p[INCISE_MODEL_INPUTS_MAX + 1], sum = 0;
	int rc = lsq ? 0 : -ENOMEM;

	for (size_t n = 0; n < train->n && !rc; n++) {
		const double *x = train->rows + n * (d + 1);
		double *row = incise_lsq_row(lsq);

		for (int i = 0; i < d; i++)
			row[i] = (x[i] - columns[i].mean) / columns[i].sd;
		row[d] = 1;
		incise_lsq_add(lsq, (x[d] - columns[d].mean) / columns[d].sd);
	}
	if (!rc)
		rc = incise_lsq_solve(lsq, &ridge, p);
	for (size_t n = 0; n < on->n && !rc; n++) {
		const double *x = on->rows + n * (d + 1);
		double e = p[d] - (x[d] - columns[d].mean) / columns[d].sd;

		for (int i = 0; i < d; i++)
			e += p[i] * (x[i] - columns[i].mean) / columns[i].sd;
		sum += e * e / on->n;
	}
	*rmse = sqrt(sum) * columns[d].sd;
	incise_lsq_free(lsq);
	return rc;
}

/* The pairs among which neighbours are looked for. */
struct pool {
	const struct incise_pairs *train;
	const int *groups;
	const struct column *columns;
	size_t *pairs; /* n of them, in random order */
	size_t n;
	struct incise_watch *watch;
};

/* At most so many of n numbers from 0, in random order; NULL with errno ENOMEM. */
static size_t *some_of(size_t n, size_t most, size_t *count)
{
	size_t *order = malloc(n * sizeof(*order));

	if (order)
		incise_random_shuffle(order, n, 1);
	*count = n < most ? n : most;
	return order;
}

/* The group of a pair, or itself. */
static long unit_of_baselines(const struct pool *pool, size_t pair)
{
	return pool->groups ? pool->groups[pair] : (long)pair;
}

/*
 * Predictions of the output at x for all ks, from pairs of other units than the excluded
 * one; a k larger than there are pairs takes them all.
 */
static void knn_predict(const struct pool *pool, const double *x, long excluded,
			double *y)
{
	const struct incise_pairs *train = pool->train;
	const struct column *columns = pool->columns;
	double near[K_MAX], value[K_MAX];
	int width = train->n_inputs + 1, found = 0;

	if (incise_watch_count(pool->watch, (double)pool->n * width))
		return;
	for (size_t n = 0; n < pool->n; n++) {
		const double *row = train->rows + pool->pairs[n] * width;
		double distance = 0, most = found == K_MAX ? near[K_MAX - 1] : INFINITY;
		int i;

		/* Most pairs are too far by the first input alone. */
		for (int c = 0; c < train->n_inputs && distance < most; c++) {
			double e = (row[c] - x[c]) / columns[c].sd;

			distance += e * e;
		}
		if (distance >= most ||
		    (excluded >= 0 &&
		     excluded == unit_of_baselines(pool, pool->pairs[n])))
			continue;
		found += found < K_MAX;
		for (i = found - 1; i > 0 && near[i - 1] > distance; i--) {
			near[i] = near[i - 1];
			value[i] = value[i - 1];
		}
		near[i] = distance;
		value[i] = row[train->n_inputs];
	}
	for (int i = 0; i < N_KS; i++) {
		int k = ks[i] < found ? ks[i] : found;

		y[i] = found ? 0 : columns[train->n_inputs].mean;
		for (int j = 0; j < k; j++)
			y[i] += value[j] / k;
	}
}

/* Index of the k with the least error when each pair is predicted without its own unit. */
static int choose_k(const struct pool *pool)
{
	int width = pool->train->n_inputs + 1, best = 0;
	const struct column *output = &pool->columns[width - 1];
	double sum[N_KS] = {0}, y[N_KS] = {0};

	for (size_t n = 0; n < pool->n && n < CHOOSERS; n++) {
		const double *x = pool->train->rows + pool->pairs[n] * width;

		knn_predict(pool, x, unit_of_baselines(pool, pool->pairs[n]), y);
		for (int i = 0; i < N_KS; i++) {
			double e = (y[i] - x[width - 1]) / output->sd;

			sum[i] += e * e;
		}
	}
	for (int i = 1; i < N_KS; i++)
		if (sum[i] < sum[best])
			best = i;
	return best;
}

static int knn_rmse(struct pool *pool, const struct incise_pairs *on,
		    struct incise_baselines *result)
{
	int d = on->n_inputs, best;
	const struct column *output = &pool->columns[d];
	double sum = 0, y[N_KS] = {0};
	size_t n_queries, *queries = some_of(on->n, QUERIES_MAX, &n_queries);

	pool->pairs = some_of(pool->train->n, POOL_MAX, &pool->n);
	if (!pool->pairs || !queries) {
		free(queries);
		return -ENOMEM;
	}
	best = choose_k(pool);
	for (size_t n = 0; n < n_queries; n++) {
		const double *x = on->rows + queries[n] * (d + 1);
		double e;

		/* A pair that was fitted on must not be its own neighbour. */
		knn_predict(pool, x,
			    on->rows == pool->train->rows
				    ? unit_of_baselines(pool, queries[n])
				    : -1,
			    y);
		e = (x[d] - y[best]) / output->sd;
		sum += e * e / n_queries;
	}
	result->knn = sqrt(sum) * output->sd;
	result->k = ks[best];
	free(queries);
	return 0;
}

int incise_baselines(const struct incise_pairs *train, const int *groups,
		     const struct incise_pairs *on, incise_train_progress progress,
		     void *user, struct incise_baselines *result,
		     struct incise_error *err)
{
	struct column columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_watch watch = {progress, user, .step.phase = INCISE_TRAIN_SOLVE};
	struct pool pool = {
		.train = train, .groups = groups, .columns = columns, .watch = &watch};
	int d = train->n_inputs, rc;
	double mean = 0;

	if (!train->n || !on->n || on->n_inputs != d || d > INCISE_MODEL_INPUTS_MAX)
		return incise_error_set(err, EINVAL,
					"baselines: no pairs, or pairs with different "
					"numbers of inputs");
	find_columns(train, columns);
	rc = linear_rmse(train, on, columns, &result->linear);
	if (!rc)
		rc = knn_rmse(&pool, on, result);
	free(pool.pairs);
	if (watch.stopped)
		return incise_error_set(err, ECANCELED, "training was stopped");
	if (rc)
		return incise_error_set(err, -rc,
					rc == -ENOMEM
						? "baselines: no memory"
						: "baselines: linear regression failed");
	for (size_t n = 0; n < on->n; n++) {
		const double *x = on->rows + n * (d + 1);
		double e = (x[d] - columns[d].mean) / columns[d].sd;

		mean += e * e / on->n;
	}
	result->mean = sqrt(mean) * columns[d].sd;
	return 0;
}
