// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Evaluating compiled models at the ends of what there is: inputs outside, the largest consequents, numbers
 * that are none. Runs under UBSan as well, which sees overflows and wrong shifts. ../model/model_grid.c
 * compares them with double.
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_clamped_outside_the_support),
		cmocka_unit_test(test_largest_models),
		cmocka_unit_test(test_double_front),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
