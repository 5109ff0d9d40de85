// SPDX-License-Identifier: GPL-2.0-or-later
/* Choosing how many membership functions there should be: as many as the data need. */
#include "../unit.h"
#include <incise/train.h>
#include "../../../lib/base/random.h"

static double rows[400 * 3];

/* A force that bends so often with the first input and is a line in the second. */
static void choose(double bends, double noise, size_t n, int *n_mfs, int want)
{
	static const char *const names[] = {"a", "b", "y"};
	struct incise_pairs pairs = {.rows = rows, .n = n, .n_inputs = 2};
	struct incise_train_options options;
	struct incise_error err = {0};
	struct incise_model *model;
	uint64_t seed = 4;

	for (size_t i = 0; i < n; i++) {
		double *x = rows + 3 * i;

		x[0] = (1 + incise_random_symmetric(&seed)) / 2;
		x[1] = (1 + incise_random_symmetric(&seed)) / 2;
		x[2] = sin(bends * M_PI * x[0]) + x[1] +
		       noise * incise_random_symmetric(&seed);
	}
	incise_train_options_init(&options);
	n_mfs[0] = 0;
	model = incise_train_start(&pairs, names, INCISE_MF_GAUSS, n_mfs, &options, &err);
	assert_int_equal(model ? 0 : -errno, want);
	incise_model_free(model);
	if (want)
		assert_says(err.text, "pairs");
}

TEST(test_as_many_as_needed)
{
	int flat[2], wavy[2], noise[2];

	choose(0.2, 0.3, 400, flat, 0);
	choose(4, 0.1, 400, wavy, 0);
	choose(0, 30, 400, noise, 0);
	assert_true(flat[0] <= 2 && flat[1] == 1);
	/* Four bends: a rule is a line, two cannot follow. */
	assert_true(wavy[0] >= 4 && wavy[1] == 1);
	assert_true(noise[0] * noise[1] == 1);
}

TEST(test_few_pairs)
{
	int n_mfs[2];

	/* Two pairs a parameter: at most a rule. */
	choose(4, 0.1, 11, n_mfs, 0);
	assert_true(n_mfs[0] == 1 && n_mfs[1] == 1);
	choose(4, 0.1, 5, n_mfs, -ENODATA);
	choose(4, 0.1, 3, n_mfs, -ENODATA);
}

/* Ranges are those of the pairs; functions are counted where no number is given. */
TEST(test_start)
{
	static const char *const names[] = {"a", "b", "y"};
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};
	struct incise_train_options options;
	struct incise_model *model;
	int n_mfs[2], chosen[2] = {0}, given[2] = {3, 2};

	choose(4, 0.1, 400, n_mfs, 0);
	incise_train_options_init(&options);
	model = incise_train_start(&pairs, names, INCISE_MF_GAUSS, chosen, &options,
				   &err);
	assert_non_null(model);
	assert_string_equal(incise_model_info(model)->output.name, "y");
	assert_true(incise_model_info(model)->input[0].min >= 0 &&
		    incise_model_info(model)->input[0].max <= 1);
	for (int i = 0; i < 2; i++)
		assert_int_equal(incise_model_info(model)->n_mfs[i], chosen[i]);
	assert_true(chosen[0] >= 4 && chosen[1] == 1);
	incise_model_free(model);
	model = incise_train_start(&pairs, names, INCISE_MF_GBELL, given, &options, &err);
	assert_int_equal(incise_model_info(model)->n_rules, 6);
	incise_model_free(model);
	rows[2] = -1.5e308;
	rows[5] = 1.5e308;
	assert_null(incise_train_start(&pairs, names, INCISE_MF_GAUSS, given, &options,
				       &err));
	assert_says(err.text, "column y");
}

/* One glitched row among many neither moves the functions nor widens the ranges. */
TEST(test_a_glitch)
{
	static const char *const names[] = {"a", "b", "y"};
	struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};
	struct incise_train_options options;
	int n_mfs[2] = {5, 4};
	double centre[2], max[2];
	struct incise_model *model;

	choose(4, 0.1, 400, (int[2]){0}, 0);
	incise_train_options_init(&options);
	for (int glitch = 0; glitch < 2; glitch++) {
		if (glitch)
			rows[3 * 7] = 60;
		model = incise_train_start(&pairs, names, INCISE_MF_GAUSS, n_mfs,
					   &options, &err);
		assert_non_null(model);
		centre[glitch] = incise_model_mf(model, 0, 2)->p[1];
		max[glitch] = incise_model_info(model)->input[0].max;
		incise_model_free(model);
	}
	assert_true(fabs(centre[1] - centre[0]) < 0.05 && max[0] <= 1 && max[1] <= 1);
	/* The even grid of classic has all pairs in its range. */
	options.classic = true;
	model = incise_train_start(&pairs, names, INCISE_MF_GAUSS, n_mfs, &options, &err);
	assert_true(incise_model_info(model)->input[0].max == 60);
	incise_model_free(model);
}
