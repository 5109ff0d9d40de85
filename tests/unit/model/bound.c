// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Certified bounds: never below an error that is found, and not uselessly far above.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/model/grid.h"
#include "../fixed/compiled.h"

/* Largest error found at random points and beside knots, where interpolation is worst. */
static double found(const struct incise_fixed *fx, const struct incise_model *model)
{
	double largest = 0;
	uint64_t seed = 3;

	for (int n = 0; n < 60000; n++) {
		double x[2];

		for (int i = 0; i < fx->n_inputs; i++) {
			double min = fx->input[i].min / (double)INCISE_FIXED_ONE;
			double max = fx->input[i].max / (double)INCISE_FIXED_ONE;
			double cell = ldexp(1, fx->input[i].cell_shift - 16);

			x[i] = min + (max - min) * (paper_random(&seed) + 1) / 2;
			/* Mid-cell in turn. */
			if (n & 1 << i && fx->input[i].cells)
				x[i] = min + (floor((x[i] - min) / cell) + 0.5) * cell;
			x[i] = fmin(x[i], max);
		}
		largest = fmax(largest, fabs(incise_fixed_eval_double(fx, x) -
					     incise_model_eval(model, x, NULL)));
	}
	return largest;
}

static void test_never_below_an_error(void **state)
{
	for (uint64_t seed = 1; seed <= 12; seed++)
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_model *model =
				seed % 4 ? paper_model(INCISE_MF_GAUSS, seed,
						       1 << seed % 5)
					 : line_model(seed);
			struct incise_fixed *fx;
			double error, bound;

			if (seed % 4)
				paper_disturb(model, seed, 0.6);
			fx = compiled(model, a, seed % 3 ? 64 : 32);
			assert_non_null(fx);
			error = found(fx, model);
			bound = incise_fixed_bound(fx);
			assert_true(error <= bound);
			/* Rounding is bounded by its worst case at every step, which never all
			 * come together: 8 µN aside, interpolation is met within 4. */
			assert_true(bound < 4 * error + 60e-6 * (1 << seed % 5));
			incise_fixed_free(fx);
			incise_model_free(model);
		}
}

/*
 * Supports end anywhere, and are compiled to the nearest LSB: what holds for every real
 * input has to hold at the very ends, and for functions that cross just outside.
 */
static void test_ends_between_lsbs(void **state)
{
	static const struct incise_variable out = {"y", 0, 1};
	static const int mfs[] = {2};
	uint64_t seed = 1;
	int compiled_models = 0;

	for (int n = 0; n < 300; n++) {
		double min = 2 * paper_random(&seed);
		struct incise_variable in = {"x", min,
					     min + 1.05e-3 + 1e-4 * paper_random(&seed)};
		struct incise_model *model =
			incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &out, NULL);
		/* Half an LSB is 7.6e-6: the functions cross within that outside an end. */
		double cross = (n % 2 ? in.min : in.max) + 7e-6 * paper_random(&seed);
		double half = 0.0365, width = 3.8e-4 * pow(10, n % 3 - 1);

		incise_model_set_mf(model, 0, 0, (double[4]){width, cross - half});
		incise_model_set_mf(model, 0, 1, (double[4]){width, cross + half});
		incise_model_set_consequent(model, 0, (double[]){1, 0});
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_fixed *fx = compiled(model, a, 32);

			if (!fx)
				continue;
			compiled_models++;
			for (int k = 0; k <= 200; k++) {
				double u = k / 200.0,
				       x[] = {in.min * (1 - u) + in.max * u};

				assert_true(fabs(incise_fixed_eval_double(fx, x) -
						 incise_model_eval(model, x, NULL)) <=
					    incise_fixed_bound(fx));
			}
			incise_fixed_free(fx);
		}
		incise_model_free(model);
	}
	assert_true(compiled_models > 300);
}

/* A plane has no second derivative: interpolation is exact and the bound knows it. */
static void test_plane_needs_no_cells(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	struct incise_fixed *fx;

	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r, (double[]){0.5, 0.05, 0.01});
	fx = compiled(model, INCISE_FIXED_FORCE, 32);
	/* Half an LSB of output and of inputs, and the table's. */
	assert_true(incise_fixed_bound(fx) < 10e-6);
	incise_fixed_free(fx);
	incise_model_free(model);
}

static void test_finer_cells_lower_bound(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 5, 4);
	struct incise_grid *grid = malloc(sizeof(*grid));
	struct incise_survey *survey;
	double last = INFINITY;

	assert_int_equal(incise_grid_init(grid, model, NULL), 0);
	survey = incise_survey_new(grid);
	for (double w = 1; w > 1e-3; w /= 2) {
		double table = incise_survey_table(survey, w, 2 * w);

		assert_true(table < last);
		/* Weights and outputs are smoother than their product's cell by cell. */
		assert_true(incise_survey_force(survey, w, 2 * w) > 0);
		last = table;
	}
	incise_survey_free(survey);
	free(grid);
	incise_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_never_below_an_error),
		cmocka_unit_test(test_ends_between_lsbs),
		cmocka_unit_test(test_plane_needs_no_cells),
		cmocka_unit_test(test_finer_cells_lower_bound),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
