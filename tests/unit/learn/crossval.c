// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Cross-validation: whole groups are held out, and errors are those of fits without them.
 */
#include "../unit.h"
#include "../../../lib/learn/crossval.h"
#include "../../../lib/base/random.h"

#define PAIRS 240

static double rows[PAIRS * 2];
static int groups[PAIRS];
static const struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 1};

static void fill(int per_group)
{
	uint64_t seed = 5;

	for (int i = 0; i < PAIRS; i++) {
		rows[2 * i] = (1 + incise_random_symmetric(&seed)) / 2;
		rows[2 * i + 1] =
			sin(5 * rows[2 * i]) + 0.1 * incise_random_symmetric(&seed);
		/* With gaps, as when others lie on the check side. */
		groups[i] = 3 * (i / per_group) + 2;
	}
}

static void one_rule(struct incise_basis *basis, int n)
{
	static const struct incise_variable in = {"x", 0, 1};
	struct incise_model *model =
		incise_model_new_grid(1, &in, &n, INCISE_MF_GAUSS, &in, NULL);

	assert_int_equal(incise_basis_init(basis, model), 0);
	incise_model_free(model);
}

static int group_of(const double *row)
{
	for (int i = 0; i < PAIRS; i++)
		/* Inputs that are held out are clamped. */
		if (rows[2 * i + 1] == row[1])
			return groups[i];
	fail();
	return -1;
}

/* Every pair is held out once, never beside its own group. */
TEST(test_groups_stay_together)
{
	static const struct {
		int per_group, n, units;
	} cases[] = {{10, 5, 24}, {60, 4, 4}, {120, 2, 2}, {48, 5, 5}, {1000, 5, 240}};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct incise_folds folds;
		size_t held = 0;

		fill(cases[c].per_group);
		assert_int_equal(incise_folds_init(&folds, &pairs, groups, 3), 0);
		assert_int_equal(folds.n, cases[c].n);
		assert_int_equal(folds.n_units, cases[c].units);
		for (int f = 0; f < folds.n; f++) {
			held += folds.held[f].n;
			assert_int_equal(folds.held[f].n + folds.fit[f].n, PAIRS);
			assert_true(folds.held[f].n > 0);
			/* One group only is split by pairs. */
			if (cases[c].units == PAIRS)
				continue;
			for (size_t i = 0; i < folds.held[f].n; i++)
				for (size_t k = 0; k < folds.fit[f].n; k++)
					if (group_of(folds.held[f].rows + 2 * i) ==
					    group_of(folds.fit[f].rows + 2 * k))
						fail_msg("a group is on both sides");
		}
		incise_folds_free(&folds);
		assert_int_equal(held, PAIRS);
		assert_int_equal(held, folds.n_held);
	}
}

/* One rule is a line: held-out errors are those of lines through the other pairs. */
TEST(test_errors)
{
	struct incise_ridge ridge = {.ridge = 1e-12, .n = 2};
	struct incise_folds folds;
	struct incise_basis basis;
	double want = 0, *error;

	fill(10);
	one_rule(&basis, 1);
	assert_int_equal(incise_folds_init(&folds, &pairs, groups, 3), 0);
	error = malloc(folds.n_units * sizeof(*error));
	assert_int_equal(incise_crossval_ridges(&basis, &folds, &ridge, 1, error), 0);
	for (int f = 0; f < folds.n; f++) {
		const struct incise_pairs *fit = &folds.fit[f];
		double mx = 0, my = 0, xy = 0, xx = 0;

		for (size_t i = 0; i < fit->n; i++) {
			mx += fit->rows[2 * i] / fit->n;
			my += fit->rows[2 * i + 1] / fit->n;
		}
		for (size_t i = 0; i < fit->n; i++) {
			xy += (fit->rows[2 * i] - mx) * (fit->rows[2 * i + 1] - my);
			xx += pow(fit->rows[2 * i] - mx, 2);
		}
		for (size_t i = 0; i < folds.held[f].n; i++) {
			const double *row = folds.held[f].rows + 2 * i;

			want += pow(my + xy / xx * (row[0] - mx) - row[1], 2);
		}
	}
	assert_true(fabs(incise_crossval_total(&folds, error) / want - 1) < 1e-9);
	free(error);
	incise_folds_free(&folds);
}

/* Ratios are errors, a bit shrunk. */
TEST(test_ratios)
{
	struct incise_ridge ridge = {.ridge = 0.01, .n = 8};
	double *error, *ratios, sum = 0, total;
	struct incise_folds folds;
	struct incise_basis basis;

	fill(10);
	one_rule(&basis, 4);
	assert_int_equal(incise_folds_init(&folds, &pairs, groups, 3), 0);
	error = malloc(folds.n_units * sizeof(*error));
	ratios = malloc(folds.n_held * sizeof(*ratios));
	assert_int_equal(incise_crossval_ridges(&basis, &folds, &ridge, 1, error), 0);
	assert_int_equal(incise_crossval_ratios(&basis, &folds, &ridge, ratios), 0);
	total = incise_crossval_total(&folds, error);
	for (size_t i = 0; i < folds.n_held; i++)
		sum += ratios[i] * ratios[i];
	/* 8 parameters over 190 pairs: the leverage is some percent. */
	assert_true(sum < total && sum > 0.8 * total);
	free(error);
	free(ratios);
	incise_folds_free(&folds);
}

/* A curve keeps rules apart; a line under noise ends as a plane, noise alone as the mean. */
TEST(test_choice)
{
	static double other[PAIRS * 2];
	const struct incise_pairs data = {.rows = other, .n = PAIRS, .n_inputs = 1};
	double strength[3];

	fill(10);
	for (int kind = 0; kind < 3; kind++) {
		uint64_t seed = 9;
		struct incise_choice choice;
		struct incise_folds folds;
		struct incise_basis basis;

		for (int i = 0; i < PAIRS; i++) {
			double x = other[2 * i] = rows[2 * i];

			other[2 * i + 1] = (kind == 0	? sin(9 * x)
					    : kind == 1 ? x
							: 0) +
					   0.3 * incise_random_symmetric(&seed);
		}
		one_rule(&basis, 4);
		assert_int_equal(incise_folds_init(&folds, &data, NULL, 3), 0);
		assert_int_equal(incise_crossval_choose(&basis, &folds, NULL, &choice),
				 0);
		strength[kind] = choice.ridge.ridge;
		assert_true(choice.total <= choice.plane && choice.total <= choice.mean);
		assert_true(incise_crossval_total(&folds, choice.error) == choice.total);
		if (kind == 2)
			assert_true(choice.mean < 1.02 * choice.total);
		free(choice.error);
		incise_folds_free(&folds);
	}
	assert_true(strength[0] < 100 && strength[1] >= 100 && strength[2] >= 100);
}

/* Three cuts of one law with noise are best told by it; it goes through 0 and follows the square. */
TEST(test_quadratic)
{
	static double curved[PAIRS * 2];
	const struct incise_pairs data = {.rows = curved, .n = PAIRS, .n_inputs = 1};
	/* Of inputs from 2 to 12, and outputs as they are. */
	const double offset[] = {2, 1}, scale[] = {10, 3};
	const int n_mfs = 5;
	struct incise_choice choice;
	struct incise_folds folds;
	struct incise_basis basis;
	struct incise_lsq *lsq;
	double x[2 * 5], *law;
	uint64_t seed = 9;

	fill(80);
	one_rule(&basis, n_mfs);
	for (int i = 0; i < PAIRS; i++) {
		double depth = 2 + 10 * rows[2 * i];

		curved[2 * i] = rows[2 * i];
		curved[2 * i + 1] = (0.2 * depth + 0.1 * depth * depth - 1) / 3 +
				    incise_random_symmetric(&seed);
	}
	law = incise_quadratic(&basis, offset, scale);
	assert_non_null(law);
	assert_int_equal(incise_folds_init(&folds, &data, groups, 3), 0);
	assert_int_equal(incise_crossval_choose(&basis, &folds, law, &choice), 0);
	assert_true(choice.total == choice.quadratic && choice.ridge.free == law);
	lsq = incise_lsq_new(10, NULL);
	incise_basis_fold(&basis, &data, lsq);
	assert_int_equal(incise_lsq_solve(lsq, &choice.ridge, x), 0);
	/* The grid has the square to 0.02 of the range's, and noise leaves as much. */
	for (double u = 0; u <= 1; u += 0.125) {
		double depth = 2 + 10 * u;
		double want = (0.2 * depth + 0.1 * depth * depth - 1) / 3;
		double pair[] = {u, want};

		assert_true(fabs(incise_basis_error(&basis, pair, x)) < 0.2);
	}
	incise_lsq_free(lsq);
	free(choice.error);
	free(law);
	incise_folds_free(&folds);
	/* One function has no square. */
	one_rule(&basis, 1);
	assert_null(incise_quadratic(&basis, offset, scale));
}

/* A force that is 0 at depth 0 at any speed pulls to the law with products, which follows it. */
TEST(test_products)
{
	static const struct incise_variable in[] = {{"d", 0, 1}, {"v", 0, 1}};
	static const int n_mfs[] = {5, 4};
	static double product[PAIRS * 3];
	const struct incise_pairs data = {.rows = product, .n = PAIRS, .n_inputs = 2};
	const double offset[] = {0.5, 0, 1}, scale[] = {20, 50, 3};
	struct incise_model *model =
		incise_model_new_grid(2, in, n_mfs, INCISE_MF_GAUSS, in, NULL);
	struct incise_choice choice;
	struct incise_folds folds;
	struct incise_basis basis;
	uint64_t seed = 9;
	double *law;

	fill(20);
	assert_int_equal(incise_basis_init(&basis, model), 0);
	for (int i = 0; i < PAIRS; i++) {
		double *row = product + 3 * i;

		row[0] = rows[2 * i];
		row[1] = (1 + incise_random_symmetric(&seed)) / 2;
		row[2] = ((0.5 + 20 * row[0]) * (0.05 + 0.1 * row[1]) - 1) / 3;
	}
	law = incise_quadratic(&basis, offset, scale);
	assert_non_null(law);
	assert_int_equal(incise_folds_init(&folds, &data, groups, 3), 0);
	for (int products = 0; products < 2; products++) {
		struct incise_ridge ridge = {
			.ridge = 1e9, .n = 60, .free = law, .n_free = products ? 4 : 3};
		double error[PAIRS];

		assert_int_equal(incise_crossval_ridges(&basis, &folds, &ridge, 1, error),
				 0);
		assert_true((incise_crossval_total(&folds, error) < PAIRS * 1e-5) ==
			    products);
	}
	assert_int_equal(incise_crossval_choose(&basis, &folds, law, &choice), 0);
	assert_true(choice.total < choice.quadratic);
	free(choice.error);
	free(law);
	incise_folds_free(&folds);
	incise_model_free(model);
}

TEST(test_spread)
{
	struct incise_folds folds = {.n_units = 4};
	const double a[] = {3, 5, 4, 8}, b[] = {1, 4, 4, 5};

	/* Differences 2 1 0 3: mean 1.5, Σ(d-1.5)² = 5, times 4/3. */
	assert_true(fabs(incise_crossval_spread(folds.n_units, a, b) - sqrt(20.0 / 3)) <
		    1e-15);
	assert_true(incise_crossval_spread(folds.n_units, a, a) == 0);
	assert_true(incise_crossval_total(&folds, a) == 20);
}
