// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The model in double against a plain long-double evaluation of eq. (3), and where that
 * one breaks down.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "paper_model.h"

/* Eq. (1)–(3) as printed, with σ = √2 s. */
static long double plain(const struct incise_model *model, const double *x)
{
	long double sum = 0, weights = 0;

	for (int r = 0; r < incise_model_n_rules(model); r++) {
		const double *p = incise_model_consequent(model, r);
		long double w = 1, y = p[0];

		for (int i = 0; i < incise_model_n_inputs(model); i++) {
			const struct incise_mf *mf = incise_model_mf(
				model, i, incise_model_rule_mf(model, r, i));

			if (mf->type == INCISE_MF_GAUSS)
				w *= expl(-powl(x[i] - mf->p[1], 2) /
					  powl(M_SQRT2 * (long double)mf->p[0], 2));
			else
				w /= 1 + powl(fabsl((x[i] - mf->p[2]) / mf->p[0]),
					      2 * mf->p[1]);
			y += p[i + 1] * (long double)x[i];
		}
		sum += w * y;
		weights += w;
	}
	return sum / weights;
}

static void test_against_plain(void **state)
{
	for (int type = 0; type < 2; type++)
		for (uint64_t seed = 1; seed <= 20; seed++) {
			struct incise_model *model = paper_model(type, seed, 3);
			uint64_t points = seed;

			paper_disturb(model, seed, 0.3);
			for (int n = 0; n < 500; n++) {
				double x[] = {10 + 10 * paper_random(&points),
					      25 + 25 * paper_random(&points)};
				unsigned int flags = 99;
				double y = incise_model_eval(model, x, &flags);

				/* A few dozen roundings of terms up to 9. */
				assert_true(fabsl(y - plain(model, x)) < 1e-13);
				assert_int_equal(flags, 0);
			}
			incise_model_free(model);
		}
}

static void test_firing_adds_up_to_one(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	static const double xs[][2] = {{10, 25}, {0, 0}, {1e4, -1e4}, {1e300, 1e300}};

	for (size_t i = 0; i < 4; i++) {
		double w[20], sum = 0;

		incise_model_firing(model, xs[i], w);
		for (int r = 0; r < 20; r++) {
			assert_true(w[r] >= 0 && w[r] <= 1);
			sum += w[r];
		}
		assert_true(fabs(sum - 1) < 1e-14);
	}
	incise_model_free(model);
}

/* Far out every firing strength is zero: the nearest rule answers. */
static void test_nearest_rule_takes_over(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	const double far[] = {1000, 5000};
	const double *p = incise_model_consequent(model, 19);
	unsigned int flags;

	assert_true(isnan((double)plain(model, far)) ||
		    !isfinite((double)plain(model, far)));
	incise_model_set_clamp(model, false);
	assert_true(fabs(incise_model_eval(model, far, &flags) -
			 (p[0] + p[1] * 1000 + p[2] * 5000)) < 1e-9);
	assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
	/* Clamped it is the edge of the support. */
	incise_model_set_clamp(model, true);
	assert_true(incise_model_eval(model, far, &flags) ==
		    incise_model_eval(model, (double[]){20, 50}, NULL));
	assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
	incise_model_free(model);
}

static void test_no_input_yields_nan(void **state)
{
	static const double hostile[] = {0,	   -0.0,     1e300,	-1e300,
					 NAN,	   INFINITY, -INFINITY, DBL_MAX,
					 -DBL_MAX, DBL_MIN,  5e-324};
	static const double widths[] = {1e-12, 1e-6, 1, 1e6, 1e12};
	int n = sizeof(hostile) / sizeof(*hostile);

	for (size_t w = 0; w < 5; w++)
		for (int clamp = 0; clamp < 2; clamp++) {
			struct incise_model *model = paper_model(INCISE_MF_GAUSS, 3, 1e6);

			incise_model_set_clamp(model, clamp);
			for (int k = 0; k < 5; k++) {
				double p[4] = {widths[w],
					       incise_model_mf(model, 0, k)->p[1]};

				assert_int_equal(incise_model_set_mf(model, 0, k, p), 0);
			}
			for (int i = 0; i < n * n; i++) {
				double x[] = {hostile[i / n], hostile[i % n]};

				assert_true(isfinite(incise_model_eval(model, x, NULL)));
			}
			incise_model_free(model);
		}
}

static void test_grid_shape(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);

	assert_int_equal(incise_model_n_rules(model), 20);
	/* MATLAB's order: the last input's functions follow each other fastest. */
	assert_int_equal(incise_model_rule_mf(model, 1, 0), 0);
	assert_int_equal(incise_model_rule_mf(model, 1, 1), 1);
	assert_int_equal(incise_model_rule_mf(model, 19, 0), 4);
	/* Neighbours cross at 0.5. */
	for (int k = 0; k < 4; k++)
		assert_true(
			fabs(incise_mf_eval(incise_model_mf(model, 0, k), 2.5 + 5 * k) -
			     0.5) < 1e-15 * 8);
	incise_model_free(model);
}

static void test_refusals(void **state)
{
	static const struct {
		int n_inputs, mfs;
		double min, max;
		int code;
	} cases[] = {
		{0, 2, 0, 1, EINVAL},	       {9, 2, 0, 1, EINVAL},
		{2, 0, 0, 1, EINVAL},	       {2, 33, 0, 1, EINVAL},
		{2, 2, 1, 1, EINVAL},	       {2, 2, 2, 1, EINVAL},
		{2, 2, NAN, 1, EINVAL},	       {2, 2, 0, INFINITY, EINVAL},
		{8, 4, 0, 1, E2BIG},	       {2, 17, 0, 1, E2BIG},
		{1, 2, -1e308, 1e308, EINVAL},
	};
	static const struct incise_variable out = {"y", 0, 1};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_variable in[9] = {0};
		struct incise_error err = {0};
		int mfs[9];

		for (int k = 0; k < 9; k++) {
			in[k] = (struct incise_variable){"x", cases[i].min, cases[i].max};
			mfs[k] = cases[i].mfs;
		}
		assert_null(incise_model_new_grid(cases[i].n_inputs, in, mfs,
						  INCISE_MF_GAUSS, &out, &err));
		assert_int_equal(err.code, cases[i].code);
	}
}

static void test_setters_refuse_what_is_no_number(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	struct incise_model *copy = incise_model_copy(model);

	assert_int_equal(incise_model_set_mf(model, 0, 0, (double[4]){-1, 0}), -EINVAL);
	assert_int_equal(incise_model_set_mf(model, 0, 0, (double[4]){1, NAN}), -EINVAL);
	assert_int_equal(incise_model_set_consequent(model, 0,
						     (double[]){0, 0, INFINITY}),
			 -EINVAL);
	assert_memory_equal(incise_model_mf(model, 0, 0)->p,
			    incise_model_mf(copy, 0, 0)->p, 16);
	assert_memory_equal(incise_model_consequent(model, 0),
			    incise_model_consequent(copy, 0), 24);
	incise_model_free(model);
	incise_model_free(copy);
}

/* A zero-order rule that is given slopes is one of first order, in the file too. */
static void test_constant_rule_takes_slopes(void **state)
{
	char path[] = "/tmp/incise-model-XXXXXX";
	static const char text[] =
		"[System]\nName='c'\nType='sugeno'\nNumInputs=1\nNumOutputs=1\nNumRules=1\n"
		"[Input1]\nName='x'\nRange=[0 10]\nNumMFs=1\nMF1='a':'gaussmf',[1 0]\n"
		"[Output1]\nName='y'\nNumMFs=1\nMF1='c':'constant',[1]\n"
		"[Rules]\n1, 1 (1) : 1\n";
	struct incise_model *model;
	int fd = mkstemp(path);

	assert_int_equal(write(fd, text, sizeof(text) - 1), sizeof(text) - 1);
	close(fd);
	model = incise_model_load(path, NULL);
	assert_non_null(model);
	assert_int_equal(incise_model_set_consequent(model, 0, (double[]){1, 2}), 0);
	assert_int_equal(incise_model_save(model, path, NULL), 0);
	incise_model_free(model);
	/* The output has no range: neither had it in the first file. */
	model = incise_model_load(path, NULL);
	assert_non_null(model);
	assert_true(incise_model_eval(model, (double[]){5}, NULL) == 11);
	incise_model_free(model);
	unlink(path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_against_plain),
		cmocka_unit_test(test_firing_adds_up_to_one),
		cmocka_unit_test(test_nearest_rule_takes_over),
		cmocka_unit_test(test_no_input_yields_nan),
		cmocka_unit_test(test_grid_shape),
		cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_constant_rule_takes_slopes),
		cmocka_unit_test(test_setters_refuse_what_is_no_number),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
