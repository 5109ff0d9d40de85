// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The noise: with it, the interval holds 95 % of groups that nobody has seen.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <incise/train.h>
#include "../../../lib/learn/posterior.h"
#include "../../../lib/learn/shuffle.h"

#define GROUPS 60
#define PER_GROUP 10

static double rows[2 * GROUPS * PER_GROUP * 2];
static int groups[GROUPS * PER_GROUP];

/* About normal, variance 1: twelve uniforms of variance 1/3 over two. */
static double normal(uint64_t *seed)
{
	double sum = 0;

	for (int i = 0; i < 12; i++)
		sum += incise_random(seed);
	return sum / 2;
}

/*
 * Half of the groups train, half are new. Each has a level of its own (0.3) beside the
 * noise of its pairs (0.1): the noise of residuals alone would hold a third as much.
 */
static void test_new_groups_are_covered(void **state)
{
	static const struct incise_variable in = {"x", 0, 1}, out = {"y", -1, 1};
	const int n_mfs = 3, half = GROUPS * PER_GROUP;
	struct incise_pairs train = {rows, half, 1};
	struct incise_uncertainty *uncertainty = NULL;
	struct incise_train_options options;
	struct incise_model *model =
		incise_model_new_grid(1, &in, &n_mfs, INCISE_MF_GAUSS, &out, NULL);
	uint64_t seed = 11;
	int inside = 0;
	double noise;

	for (int g = 0; g < 2 * GROUPS; g++) {
		double level = 0.3 * normal(&seed);

		for (int i = g * PER_GROUP; i < (g + 1) * PER_GROUP; i++) {
			rows[2 * i] = (1 + incise_random(&seed)) / 2;
			rows[2 * i + 1] =
				sin(3 * rows[2 * i]) + level + 0.1 * normal(&seed);
			if (i < half)
				groups[i] = g;
		}
	}
	incise_train_options_init(&options);
	options.groups = groups;
	options.uncertainty = &uncertainty;
	assert_int_equal(incise_train(model, &train, NULL, &options, NULL, NULL), 0);
	assert_non_null(uncertainty);
	noise = incise_uncertainty_noise(uncertainty);
	/* √(0.3² + 0.1²) = 0.316; 60 levels tell it to 10 %, taken twice. */
	assert_true(noise > 0.25 && noise < 0.38);
	for (int i = half; i < 2 * half; i++) {
		double sd = incise_uncertainty_sd(uncertainty, model, rows + 2 * i);
		double e = incise_model_eval(model, rows + 2 * i, NULL) - rows[2 * i + 1];

		assert_true(sd >= noise);
		inside += fabs(e) <= INCISE_INTERVAL95 * sd;
	}
	/* 60 levels: 57 expected, give or take two standard deviations of 1.7. */
	assert_true(inside > 0.89 * half);
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
}

/* Where there were no data the model knows less. */
static void test_sd_grows_where_data_are_missing(void **state)
{
	static const struct incise_variable in = {"x", 0, 1}, out = {"y", -1, 1};
	const int n_mfs = 4;
	struct incise_pairs train = {rows, 200, 1};
	struct incise_uncertainty *uncertainty = NULL;
	struct incise_train_options options;
	struct incise_model *model =
		incise_model_new_grid(1, &in, &n_mfs, INCISE_MF_GAUSS, &out, NULL);
	uint64_t seed = 3;
	double here = 0.2, there = 0.95;

	for (int i = 0; i < 200; i++) {
		rows[2 * i] = 0.25 + 0.25 * incise_random(&seed);
		rows[2 * i + 1] = rows[2 * i] + 0.1 * normal(&seed);
	}
	incise_train_options_init(&options);
	options.ridge = 1e-3;
	options.uncertainty = &uncertainty;
	assert_int_equal(incise_train(model, &train, NULL, &options, NULL, NULL), 0);
	assert_true(incise_uncertainty_sd(uncertainty, model, &there) >
		    2 * incise_uncertainty_sd(uncertainty, model, &here));
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_new_groups_are_covered),
		cmocka_unit_test(test_sd_grows_where_data_are_missing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
