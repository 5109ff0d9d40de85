// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Compiling to fixed point: accuracy over the support, and what is refused by name.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <string.h>
#include <incise/fixed.h>
#include "../../../lib/model/model.h"
#include "paper_model.h"

/*
 * Largest difference from double on a grid and at random points. With rounded, both get
 * inputs that Q16.16 holds exactly, which leaves the arithmetic's own error.
 */
static double difference(const struct incise_model *model, bool rounded)
{
	struct incise_fixed fixed;
	uint64_t seed = 9;
	double largest = 0;

	assert_int_equal(incise_fixed_compile(model, &fixed, NULL), 0);
	for (int n = 0; n < 101 * 101 + 10000; n++) {
		double u = n < 10201 ? n / 101 / 100.0 : (paper_random(&seed) + 1) / 2;
		double w = n < 10201 ? n % 101 / 100.0 : (paper_random(&seed) + 1) / 2;
		double x[] = {u * 20, w * 50};

		for (int i = 0; i < 2 && rounded; i++)
			x[i] = rint(x[i] * INCISE_FIXED_ONE) / INCISE_FIXED_ONE;
		largest = fmax(largest, fabs(incise_fixed_eval_double(&fixed, x) -
					     incise_model_eval(model, x, NULL)));
	}
	return largest;
}

/*
 * Issue 2 asks for 1 mN on models of the paper's size. The arithmetic's part: half an LSB
 * of the output (7.6 µN), and degrees and distances that are off by some 1e-7, times the
 * 12 N that neighbouring rules of these models can differ by: 10 µN.
 */
static void test_within_tolerance_of_double(void **state)
{
	for (uint64_t seed = 1; seed <= 30; seed++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, seed, 4);

		paper_disturb(model, seed, 0.5);
		assert_true(difference(model, true) < 10e-6);
		assert_true(difference(model, false) < 1e-3);
		incise_model_free(model);
	}
}

/*
 * Consequents that nearly cancel, as unregularised training leaves them: up to 600 N.
 * The error grows with them, and the inputs' rounding most.
 */
static void test_large_consequents(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 3, 200);

	assert_true(difference(model, true) < 50 * 10e-6);
	assert_true(difference(model, false) < 50 * 50e-6);
	incise_model_free(model);
}

static void test_refusals(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GBELL, 1, 1);
	struct incise_error err = {0};
	struct incise_fixed fixed;

	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ENOTSUP);
	assert_non_null(strstr(err.text, "in1mf1 is a gbellmf"));
	incise_model_free(model);

	/* Each other kind by its name, and min. */
	for (int type = INCISE_MF_GAUSS2; type < INCISE_MF_SIG; type++) {
		model = paper_model(type, 1, 1);
		assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ENOTSUP);
		assert_non_null(strstr(err.text, incise_mf_type_name(type)));
		incise_model_free(model);
	}
	model = paper_model(INCISE_MF_GAUSS, 1, 1);
	model->and_method = INCISE_AND_MIN;
	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ENOTSUP);
	assert_non_null(strstr(err.text, "AndMethod is min"));
	incise_model_free(model);

	model = paper_model(INCISE_MF_GAUSS, 1, 1e9);
	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ERANGE);
	assert_non_null(strstr(err.text, "too large"));
	incise_model_free(model);

	model = paper_model(INCISE_MF_GAUSS, 1, 1);
	for (int k = 0; k < 5; k++)
		incise_model_set_mf(model, 0, k,
				    (double[4]){1e-3,
						incise_model_mf(model, 0, k)->p[1]});
	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ERANGE);
	assert_non_null(strstr(err.text, "within 150 widths"));
	for (int k = 0; k < 5; k++)
		incise_model_set_mf(model, 0, k,
				    (double[4]){1e-12,
						incise_model_mf(model, 0, k)->p[1]});
	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ERANGE);
	assert_non_null(strstr(err.text, "too small"));
	incise_model_set_mf(model, 0, 0, (double[4]){1, 1e9});
	assert_int_equal(incise_fixed_compile(model, &fixed, &err), -ERANGE);
	incise_model_free(model);
}

static void test_refuses_what_does_not_fit(void **state)
{
	static const struct {
		int n_inputs, mfs;
		double max;
		int code;
	} cases[] = {{5, 2, 1, -E2BIG},
		     {1, 17, 1, -E2BIG},
		     {2, 9, 1, -E2BIG},
		     {1, 2, 40000, -ERANGE},
		     {1, 2, 1e-4, -ERANGE}};
	static const struct incise_variable out = {"y", 0, 1};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_variable in[5];
		struct incise_fixed fixed;
		struct incise_model *model;
		int mfs[5];

		for (int k = 0; k < 5; k++) {
			in[k] = (struct incise_variable){"x", 0, cases[i].max};
			mfs[k] = cases[i].mfs;
		}
		model = incise_model_new_grid(cases[i].n_inputs, in, mfs, INCISE_MF_GAUSS,
					      &out, NULL);
		assert_int_equal(incise_fixed_compile(model, &fixed, NULL),
				 cases[i].code);
		incise_model_free(model);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_within_tolerance_of_double),
		cmocka_unit_test(test_large_consequents),
		cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_refuses_what_does_not_fit),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
