// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Uncertainties of pairs: weights by their formula, and the effect of a common error compared with
 * that of a fit to pairs that have this error.
 */
#include "../unit.h"
#include "../../../lib/learn/propagation.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/factor.h"

#define RIGS 8
#define ROWS 400 /* of a rig */
#define RIDGE 1e-3

static struct incise_model *premises(void)
{
	const struct incise_variable inputs[] = {{"depth_mm", 0, 20},
						 {"velocity_mm_s", 0, 50}};
	const struct incise_variable output = {"force_N", -0.5, 4};
	const int n_mfs[] = {3, 2};

	return incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &output, NULL);
}

/* Columns: own part of the force, gain (of a calibration), tip (of the depth), zero. */
static const struct incise_propagation_part parts[] = {
	{2, -1, false}, {2, 0, true}, {0, 1, true}, {2, 2, false}};
#define PARTS 4
#define WIDTH (3 + PARTS)

static void pair(int rig, int i, double own, double *row)
{
	uint64_t seed = (uint64_t)(rig * ROWS + i + 1);

	row[0] = 10 + 10 * incise_random_symmetric(&seed);
	row[1] = 25 + 25 * incise_random_symmetric(&seed);
	row[2] = 0.1 * row[0] + sin(row[1] / 9) / 4 +
		 0.05 * incise_random_symmetric(&seed);
	row[3] = own;
	row[4] = -0.02 * row[2];
	row[5] = 0.1;
	row[6] = 0.01;
}

/*
 * A pass over some rigs; of rig 0 the output moves by @error times the gain's part and the zero's.
 * The weights are those of @p, or 1.
 */
static struct incise_model *fit(struct incise_propagation *p,
				const struct incise_model *start, int rigs, double error,
				struct incise_uncertainty **uncertainty, double *scatter)
{
	const struct incise_factor_ridge ridge = {RIDGE, 0.3};
	struct incise_model *bare = premises(), *model;
	struct incise_factor *factor = incise_factor_new(bare, NULL);

	if (p)
		assert_int_equal(incise_propagation_start(p, start, *scatter, NULL), 0);
	for (int rig = 0; rig < rigs; rig++) {
		char name[20];

		snprintf(name, sizeof(name), "rig %d", rig);
		if (p)
			assert_int_equal(incise_propagation_origin(p, name, name, NULL),
					 0);
		for (int i = 0; i < ROWS; i++) {
			double row[WIDTH], w = 1;

			pair(rig, i, 0, row);
			if (p)
				w = incise_propagation_add(p, row);
			if (!rig)
				row[2] += error * (row[4] + row[6]);
			assert_int_equal(incise_factor_add(factor, row, (uint64_t)i / 100,
							   w, NULL),
					 0);
		}
	}
	model = incise_factor_solve(factor, &ridge, NULL, uncertainty, NULL, NULL);
	assert_non_null(model);
	if (p)
		assert_int_equal(
			incise_propagation_end(p, model, *uncertainty,
					       incise_factor_rmse(factor, model, NULL),
					       scatter, NULL),
			0);
	incise_factor_free(factor);
	incise_model_free(bare);
	return model;
}

/* The final uncertainty of some rigs. */
static struct incise_uncertainty *of_rigs(int rigs, struct incise_model **model,
					  struct incise_propagation_report *report)
{
	struct incise_propagation *p = incise_propagation_new(2, parts, PARTS, NULL);
	struct incise_uncertainty *u;
	struct incise_model *next = premises();
	double scatter = 0.05;

	assert_non_null(p);
	for (int pass = 0; pass < 3; pass++) {
		*model = fit(p, next, rigs, 0, &u, &scatter);
		incise_model_free(next);
		next = *model;
		if (pass < 2)
			incise_uncertainty_free(u);
	}
	assert_int_equal(incise_propagation_finish(p, u, report, NULL), 0);
	incise_propagation_free(p);
	return u;
}

TEST(test_effect_is_that_of_pairs_with_the_error)
{
	/* Gain and zero as one source: their parts add up with their signs. */
	static const struct incise_propagation_part one[] = {
		{2, -1, false}, {2, 0, true}, {0, -1, true}, {2, 0, true}};
	struct incise_propagation *p = incise_propagation_new(2, one, PARTS, NULL);
	struct incise_model *start = premises(), *model, *moved;
	struct incise_uncertainty *u;
	struct incise_uncertainty_parts found;
	double scatter = 1e6; /* so that all weights are 1 */

	model = fit(p, start, 1, 0, &u, &scatter);
	assert_int_equal(incise_propagation_finish(p, u, NULL, NULL), 0);
	moved = fit(NULL, NULL, 1, 1, NULL, NULL);
	for (int i = 0; i < 25; i++) {
		const double x[] = {4.5 * (i % 5) + 1, 12 * (i / 5) + 1};
		double by_fit = incise_model_eval(moved, x, NULL) -
				incise_model_eval(model, x, NULL);

		incise_uncertainty_parts(u, model, x, &found);
		/* The ridge is in units of the output's deviation, which the error moves a little. */
		assert_true(fabs(found.calibration - fabs(by_fit)) < 2e-5);
		assert_true(fabs(by_fit) > 1e-4 || found.calibration < 2e-4);
		/* With one rig the other one's error is as large. */
		assert_true(fabs(found.rig - found.calibration) < 1e-9);
		assert_true(fabs(found.total * found.total - found.data * found.data -
				 found.model * found.model -
				 found.calibration * found.calibration -
				 found.rig * found.rig) < 1e-12);
	}
	incise_propagation_free(p);
	incise_uncertainty_free(u);
	incise_model_free(start);
	incise_model_free(model);
	incise_model_free(moved);
}

TEST(test_one_rig_does_not_average_out_and_many_do)
{
	struct incise_propagation_report one, many;
	struct incise_model *model;
	struct incise_uncertainty *u = of_rigs(1, &model, &one);

	incise_uncertainty_free(u);
	incise_model_free(model);
	u = of_rigs(RIGS, &model, &many);
	/* All rigs have the same parts: the mean of n independent errors. 2 %: the fits differ. */
	assert_true(fabs(one.calibration / many.calibration - sqrt(RIGS)) <
		    0.02 * sqrt(RIGS));
	assert_true(fabs(one.rig / many.rig - 1) < 0.02);
	/* √((0.02 y)² + (0.1 · slope)² + 0.01²), the slope of the depth about 0.1 N/mm. */
	assert_true(one.rig > 0.015 && one.rig < 0.05);
	assert_int_equal(many.calibrations, RIGS);
	assert_int_equal(one.recordings, 1);
	/* The scatter between rigs that the calibrations explain is taken out of the noise. */
	assert_true(incise_uncertainty_noise(u) < 0.3);
	incise_uncertainty_free(u);
	incise_model_free(model);
}

TEST(test_weights_are_those_of_the_effective_variance)
{
	static const struct incise_propagation_part own[] = {
		{2, -1, false}, {0, -1, false}, {1, -1, false}, {0, -1, false}};
	struct incise_propagation *p = incise_propagation_new(2, own, PARTS, NULL);
	struct incise_uncertainty *u;
	double scatter = 0.05, x[WIDTH], y, slope[2], own2;
	struct incise_model *model = fit(NULL, NULL, 1, 0, &u, &scatter);

	assert_int_equal(incise_propagation_start(p, model, 0.2, NULL), 0);
	assert_int_equal(incise_propagation_origin(p, "a", "a", NULL), 0);
	for (int i = 0; i < 20; i++) {
		pair(0, i, 0.1 + 0.01 * i, x);
		incise_model_eval_many(model, x, 1, &y, slope);
		own2 = x[3] * x[3] + pow(slope[0] * x[4], 2) + pow(slope[1] * x[5], 2) +
		       pow(slope[0] * x[6], 2);
		assert_true(fabs(incise_propagation_add(p, x) - 0.04 / (0.04 + own2)) <
			    1e-12);
	}
	incise_propagation_free(p);
	incise_uncertainty_free(u);
	incise_model_free(model);
}

TEST(test_what_cannot_be)
{
	static const struct incise_propagation_part bad[] = {
		{3, -1, false}, {-1, -1, false}, {0, INCISE_UNCERTAINTY_SOURCES, true}};
	struct incise_propagation *p = incise_propagation_new(2, parts, PARTS, NULL);
	struct incise_model *model = premises();
	struct incise_uncertainty *u;
	double scatter = 1;
	struct incise_model *fitted = fit(NULL, NULL, 1, 0, &u, NULL);

	for (int i = 0; i < 3; i++) {
		errno = 0;
		assert_null(incise_propagation_new(2, bad + i, 1, NULL));
		assert_int_equal(errno, EINVAL);
	}
	assert_int_equal(incise_propagation_start(p, model, 0, NULL), -EINVAL);
	assert_int_equal(incise_propagation_start(p, model, NAN, NULL), -EINVAL);
	assert_int_equal(incise_propagation_finish(p, u, NULL, NULL), -EINVAL);
	assert_int_equal(incise_propagation_start(p, model, 1, NULL), 0);
	assert_int_equal(incise_propagation_end(p, fitted, u, 1, &scatter, NULL),
			 -ENODATA);
	incise_propagation_free(NULL);
	incise_propagation_free(p);
	incise_uncertainty_free(u);
	incise_model_free(model);
	incise_model_free(fitted);
}
