// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integer evaluator: exact where exactness can be had, clamped outside, never
 * overflowing (this runs under UBSan as well).
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <limits.h>
#include <math.h>
#include <string.h>
#include <incise/fixed.h>
#include "../model/paper_model.h"

/* Weights are normalised: equal rules give their common value, whatever the weights. */
static void test_constant_model(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	struct incise_fixed fixed;

	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r, (double[]){1.5, 0, 0});
	assert_int_equal(incise_fixed_compile(model, &fixed, NULL), 0);
	for (int32_t d = 0; d <= 20; d++)
		for (int32_t v = 0; v <= 50; v++) {
			int32_t x[] = {d * INCISE_FIXED_ONE, v * INCISE_FIXED_ONE};

			assert_int_equal(incise_fixed_eval(&fixed, x),
					 3 * INCISE_FIXED_ONE / 2);
		}
	incise_model_free(model);
}

/* A convex combination: the output lies between the rules' outputs. */
static void test_between_the_rules(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 2, 1);
	struct incise_fixed fixed;
	uint64_t seed = 3;

	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r, (double[]){r % 2 ? 2 : -1, 0, 0});
	assert_int_equal(incise_fixed_compile(model, &fixed, NULL), 0);
	for (int n = 0; n < 100000; n++) {
		int32_t x[] = {(int32_t)(paper_random(&seed) * INT32_MAX),
			       (int32_t)(paper_random(&seed) * INT32_MAX)};
		int32_t y = incise_fixed_eval(&fixed, x);

		assert_in_range(y + INCISE_FIXED_ONE, 0, 3 * INCISE_FIXED_ONE);
	}
	incise_model_free(model);
}

static void test_clamped_outside_the_support(void **state)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MIN + 1, -1,
				       20 * INCISE_FIXED_ONE + 1, INT32_MAX};
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 4, 4);
	struct incise_fixed fixed;

	assert_int_equal(incise_fixed_compile(model, &fixed, NULL), 0);
	for (size_t i = 0; i < 5; i++) {
		int32_t x[] = {ends[i], ends[i] < 0 ? ends[i] : INT32_MAX};
		int32_t edge[] = {ends[i] < 0 ? 0 : 20 * INCISE_FIXED_ONE,
				  ends[i] < 0 ? 0 : 50 * INCISE_FIXED_ONE};

		assert_int_equal(incise_fixed_eval(&fixed, x),
				 incise_fixed_eval(&fixed, edge));
	}
	incise_model_free(model);
}

/* Any model that compiles must not overflow anywhere: the largest that do. */
static void test_largest_models(void **state)
{
	uint64_t seed = 5;
	int compiled = 0;

	for (int e = 0; e < 40; e++) {
		struct incise_model *model =
			paper_model(INCISE_MF_GAUSS, e, pow(2, e / 2.0));
		struct incise_fixed fixed;

		if (!incise_fixed_compile(model, &fixed, NULL)) {
			compiled++;
			for (int n = 0; n < 2000; n++) {
				double x[] = {10 + 11 * paper_random(&seed),
					      25 + 26 * paper_random(&seed)};
				double y = incise_model_eval(model, x, NULL);

				/* Relative to the consequents' size; wrapping would be off by
				 * the whole range. */
				assert_true(fabs(incise_fixed_eval_double(&fixed, x) -
						 y) < 1e-4 * pow(2, e / 2.0) + 1e-4);
			}
		}
		incise_model_free(model);
	}
	assert_true(compiled > 10 && compiled < 40);
}

static void test_double_front(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 6, 4);
	struct incise_fixed fixed;
	const double hostile[][2] = {{NAN, 25}, {INFINITY, -INFINITY}, {1e300, -1e300}};
	const double meant[][2] = {{10, 25}, {20, 0}, {20, 0}};

	assert_int_equal(incise_fixed_compile(model, &fixed, NULL), 0);
	for (int i = 0; i < 3; i++)
		assert_true(incise_fixed_eval_double(&fixed, hostile[i]) ==
			    incise_fixed_eval_double(&fixed, meant[i]));
	incise_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_constant_model),
		cmocka_unit_test(test_between_the_rules),
		cmocka_unit_test(test_clamped_outside_the_support),
		cmocka_unit_test(test_largest_models),
		cmocka_unit_test(test_double_front),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
