// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The arithmetic by exponentials: against double at inputs that Q16.16 holds exactly.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include "compiled.h"

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
	for (int n = 0; n < 100000; n++) {
		int32_t x[] = {(int32_t)(paper_random(&seed) * INT32_MAX),
			       (int32_t)(paper_random(&seed) * INT32_MAX)};

		assert_in_range(incise_fixed_eval(fx, x) + INCISE_FIXED_ONE, 0,
				3 * INCISE_FIXED_ONE);
	}
	incise_fixed_free(fx);
	incise_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_close_to_double),
		cmocka_unit_test(test_between_the_rules),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
