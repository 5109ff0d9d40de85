// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Evaluating compiled models: properties of every arithmetic; the direct one against double at
 * inputs that Q16.16 holds exactly; the tables' exact at knots and convergent with cells. Runs
 * under UBSan as well, which sees overflows and wrong shifts.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/base/random.h"
#include "compiled.h"
#include "../cases.h"

static int32_t uniform32(uint64_t *seed)
{
	incise_random_step(seed);
	return (int32_t)(*seed >> 32);
}

/* Equal rules give their common value whatever the weights: they are normalised. */
static void test_constant_model(void **state)
{
	for (int a = 0; a < ARITHMETICS; a++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
		struct incise_fixed *fx;

		for (int r = 0; r < 20; r++)
			incise_model_set_consequent(model, r, (double[]){1.5, 0, 0});
		fx = compiled(model, a, 32);
		assert_non_null(fx);
		for (int32_t d = 0; d <= 20; d++)
			for (int32_t v = 0; v <= 50; v++) {
				int32_t x[] = {d * INCISE_FIXED_ONE,
					       v * INCISE_FIXED_ONE};

				assert_int_equal(incise_fixed_eval(fx, x),
						 3 * INCISE_FIXED_ONE / 2);
			}
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

/* Over all of int32 the output is that of the nearest point of the support. */
static void test_clamped_outside_the_support(void **state)
{
	struct incise_model *models[] = {paper_model(INCISE_MF_GAUSS, 4, 4),
					 line_model(1)};
	static const int32_t extremes[] = {INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX};
	uint64_t seed = 1;

	for (int m = 0; m < 2; m++)
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_fixed *fx = compiled(models[m], a, 32);

			for (int n = 0; n < cases_of(20000, 1000); n++) {
				int32_t x[2], in[2];

				for (int i = 0; i < 2; i++) {
					x[i] = n < 36 ? extremes[i ? n % 6 : n / 6]
						      : uniform32(&seed);
					in[i] = x[i];
				}
				for (int i = 0; i < fx->n_inputs; i++) {
					in[i] = in[i] < fx->input[i].min
							? fx->input[i].min
							: in[i];
					in[i] = in[i] > fx->input[i].max
							? fx->input[i].max
							: in[i];
				}
				assert_int_equal(incise_fixed_eval(fx, x),
						 incise_fixed_eval(fx, in));
			}
			incise_fixed_free(fx);
		}
	incise_model_free(models[0]);
	incise_model_free(models[1]);
}

/* Models up to the largest that compile: off by no more than their bound anywhere. */
static void test_largest_models(void **state)
{
	uint64_t seed = 5;
	int done[ARITHMETICS] = {0};

	for (int e = 0; e < 40; e += 3)
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_model *model =
				paper_model(INCISE_MF_GAUSS, e, pow(2, e / 2.0));
			struct incise_fixed *fx = compiled(model, a, 64);

			for (int n = 0; fx && n < 1000; n++) {
				double x[] = {10 + 10 * paper_random(&seed),
					      25 + 25 * paper_random(&seed)};
				double y = incise_model_eval(model, x, NULL);

				/* Beyond ±32768 the output is held. */
				y = fmax(-32768, fmin(y, 32768 - 1.0 / INCISE_FIXED_ONE));
				assert_true(fabs(incise_fixed_eval_double(fx, x) - y) <=
					    incise_fixed_bound(fx));
			}
			done[a] += fx != NULL;
			incise_fixed_free(fx);
			incise_model_free(model);
		}
	for (int a = 0; a < ARITHMETICS; a++)
		assert_in_range(done[a], 4, 13);
}

static void test_double_front(void **state)
{
	const double hostile[][2] = {{NAN, 25}, {INFINITY, -INFINITY}, {1e300, -1e300}};
	const double meant[][2] = {{10, 25}, {20, 0}, {20, 0}};

	for (int a = 0; a < ARITHMETICS; a++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, 6, 4);
		struct incise_fixed *fx = compiled(model, a, 32);

		for (int i = 0; i < 3; i++)
			assert_true(incise_fixed_eval_double(fx, hostile[i]) ==
				    incise_fixed_eval_double(fx, meant[i]));
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

/* Half an LSB of the output is 7.6 µN; degrees are off by some 1e-7 times the 12 N that
 * neighbouring rules of these models differ by. */
static void test_close_to_double(void **state)
{
	for (uint64_t seed = 1; seed <= 10; seed++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, seed, 4);
		struct incise_fixed *fx;

		paper_disturb(model, seed, 0.5);
		fx = compiled(model, INCISE_FIXED_DIRECT, 0);
		assert_non_null(fx);
		for (int n = 0; n < 51 * 51; n++) {
			int32_t q[] = {n / 51 * 20 * INCISE_FIXED_ONE / 50,
				       n % 51 * INCISE_FIXED_ONE};
			double x[] = {q[0] / (double)INCISE_FIXED_ONE,
				      q[1] / (double)INCISE_FIXED_ONE};

			assert_true(
				fabs(incise_fixed_eval(fx, q) / (double)INCISE_FIXED_ONE -
				     incise_model_eval(model, x, NULL)) < 10e-6);
		}
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

/* The output lies between the rules': a convex combination, within rounding. */
static void test_between_the_rules(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 2, 1);
	struct incise_fixed *fx;
	uint64_t seed = 3;

	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r, (double[]){r % 2 ? 2 : -1, 0, 0});
	fx = compiled(model, INCISE_FIXED_DIRECT, 0);
	for (int n = 0; n < cases_of(100000, 5000); n++) {
		int32_t x[] = {(int32_t)(paper_random(&seed) * INT32_MAX),
			       (int32_t)(paper_random(&seed) * INT32_MAX)};

		assert_in_range(incise_fixed_eval(fx, x) + INCISE_FIXED_ONE, 0,
				3 * INCISE_FIXED_ONE);
	}
	incise_fixed_free(fx);
	incise_model_free(model);
}

/*
 * Of table and force, which interpolate between knots: at a knot nothing is interpolated, half
 * an LSB of the output and a few of the table.
 */
static void test_exact_at_knots(void **state)
{
	int arithmetic = *(const int *)*state;
	struct incise_model *models[] = {paper_model(INCISE_MF_GAUSS, 7, 2),
					 line_model(2)};

	for (int m = 0; m < 2; m++) {
		struct incise_fixed *fx = compiled(models[m], arithmetic, 64);
		int last = fx->n_inputs - 1;

		for (int k = 0; k < fx->input[0].cells; k++)
			for (int l = 0; l < (last ? fx->input[1].cells : 1); l++) {
				int32_t q[] = {fx->input[0].min +
						       (k << fx->input[0].cell_shift),
					       fx->input[1].min +
						       (l << fx->input[1].cell_shift)};
				double x[] = {q[0] / (double)INCISE_FIXED_ONE,
					      q[1] / (double)INCISE_FIXED_ONE};

				assert_true(fabs(incise_fixed_eval(fx, q) /
							 (double)INCISE_FIXED_ONE -
						 incise_model_eval(models[m], x, NULL)) <
					    8e-6);
			}
		incise_fixed_free(fx);
		incise_model_free(models[m]);
	}
}

/* Linear interpolation: four times the cells per input, a sixteenth of the error. */
static void test_error_falls_with_the_square(void **state)
{
	int arithmetic = *(const int *)*state;
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 7, 4);
	double error[2] = {0};

	for (int k = 0; k < 2; k++) {
		struct incise_fixed *fx = compiled(model, arithmetic, k ? 128 : 32);
		uint64_t seed = 1;

		for (int n = 0; n < cases_of(50000, 10000); n++) {
			double x[] = {10 + 10 * paper_random(&seed),
				      25 + 25 * paper_random(&seed)};

			error[k] =
				fmax(error[k], fabs(incise_fixed_eval_double(fx, x) -
						    incise_model_eval(model, x, NULL)));
		}
		incise_fixed_free(fx);
	}
	/* Sampling, and the next order, take their part. */
	assert_true(error[0] / error[1] > 11 && error[0] / error[1] < 23);
	incise_model_free(model);
}

int main(void)
{
	static int table = INCISE_FIXED_TABLE, force = INCISE_FIXED_FORCE;
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_constant_model),
		cmocka_unit_test(test_clamped_outside_the_support),
		cmocka_unit_test(test_largest_models),
		cmocka_unit_test(test_double_front),
		cmocka_unit_test(test_close_to_double),
		cmocka_unit_test(test_between_the_rules),
		cmocka_unit_test_prestate(test_exact_at_knots, &table),
		cmocka_unit_test_prestate(test_exact_at_knots, &force),
		cmocka_unit_test_prestate(test_error_falls_with_the_square, &table),
		cmocka_unit_test_prestate(test_error_falls_with_the_square, &force),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
