// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tuning: more noise asks for a larger ridge, planted premises are found, same seed, same choice.
 */
#include "../unit.h"
#include "../../../lib/learn/basis.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/tune.h"

#define PAIRS 200

static double rows[PAIRS * 2];

static void tune(double noise, double shift, uint64_t seed, struct incise_tuning *tuning,
		 struct incise_train_options *options)
{
	static const struct incise_variable in = {"x", 0, 1};
	struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 1};
	const int n = 5;
	struct incise_model *model =
		incise_model_new_grid(1, &in, &n, INCISE_MF_GAUSS, &in, NULL);
	struct incise_folds folds;
	struct incise_basis basis;
	uint64_t state = 5;

	for (int i = 0; i < PAIRS; i++) {
		double x = rows[2 * i] = (1 + incise_random_symmetric(&state)) / 2;

		rows[2 * i + 1] =
			tanh(20 * (x - shift)) + noise * incise_random_symmetric(&state);
	}
	assert_int_equal(incise_basis_init(&basis, model), 0);
	incise_model_free(model);
	options->seed = seed;
	assert_int_equal(incise_folds_init(&folds, &pairs, NULL, seed), 0);
	assert_int_equal(incise_tune(&basis, &folds, options, tuning), 0);
	incise_folds_free(&folds);
	/* The choices are what counts here. */
	incise_average_free(tuning->average);
	tuning->average = NULL;
}

TEST(test_noise_asks_for_ridge)
{
	struct incise_train_options options;
	struct incise_tuning quiet, loud;

	incise_train_options_init(&options);
	tune(0.001, 0.5, 1, &quiet, &options);
	tune(5, 0.5, 1, &loud, &options);
	assert_true(loud.ridge.ridge >= 100 * quiet.ridge.ridge);
	/* Uniform noise of size 5 has a spread of 2.9: nothing can be below. */
	assert_true(loud.rmse > 2.5 && quiet.rmse < 0.1);
}

/* A step in the middle of nowhere is worth moving functions for; a given ridge stays. */
TEST(test_search_pays)
{
	struct incise_train_options options;
	struct incise_tuning still, moved;

	incise_train_options_init(&options);
	options.ridge = 0.01;
	options.epochs = 1;
	options.starts = 1;
	tune(0.01, 0.37, 1, &still, &options);
	assert_int_equal(still.epochs, 1);
	options.epochs = 80;
	tune(0.01, 0.37, 1, &moved, &options);
	assert_true(moved.epochs > 1 || moved.start > 0);
	assert_true(moved.rmse < 0.9 * still.rmse);
	assert_true(moved.ridge.ridge == 0.01);
}

TEST(test_same_seed_same_choice)
{
	struct incise_train_options options;
	struct incise_tuning a, b;

	incise_train_options_init(&options);
	tune(0.1, 0.4, 7, &a, &options);
	tune(0.1, 0.4, 7, &b, &options);
	assert_true(a.rmse == b.rmse && a.epochs == b.epochs && a.start == b.start);
	assert_memory_equal(a.basis.p, b.basis.p, sizeof(a.basis.p));
}
