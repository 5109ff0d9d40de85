// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Membership functions against their formulas, and where the formulas overflow.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <float.h>
#include <math.h>
#include <string.h>
#include "../../../lib/model/model.h"

static void test_degrees(void **state)
{
	static const struct {
		struct incise_mf mf;
		double x, degree;
	} cases[] = {
		{{INCISE_MF_GAUSS, "", {2, 5}}, 5, 1},
		/* One s from the centre: e^-1/2. The paper's σ is √2 s: e^-1 there. */
		{{INCISE_MF_GAUSS, "", {2, 5}}, 7, 0.60653065971263342},
		{{INCISE_MF_GAUSS, "", {2, 5}}, 5 - 2 * M_SQRT2, 0.36787944117144233},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 6, 1},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 8, 0.5},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 2, 1 / (1 + 256.0)},
		{{INCISE_MF_GBELL, "", {1, 0.5, 0}}, -3, 0.25},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		/* exp(log) loses a few ulp. */
		assert_true(fabs(incise_mf_eval(&cases[i].mf, cases[i].x) -
				 cases[i].degree) < 8 * DBL_EPSILON);
}

/* Whatever comes in, the logarithm is a number and not positive. */
static void test_log_is_always_a_number(void **state)
{
	static const double xs[] = {0,	     -1,       1e300,	-1e300,
				    DBL_MAX, -DBL_MAX, DBL_MIN, 5e-324};
	static const double widths[] = {1e-300, 1e-12, 1, 1e12, 1e300};
	static const double slopes[] = {1e-12, 1, 1e12};

	for (size_t i = 0; i < 8; i++)
		for (size_t w = 0; w < 5; w++) {
			struct incise_mf gauss = {INCISE_MF_GAUSS, "", {widths[w], 1}};
			double log = incise_mf_log(&gauss, xs[i]);

			assert_true(isfinite(log) && log <= 0);
			for (size_t s = 0; s < 3; s++) {
				struct incise_mf bell = {
					INCISE_MF_GBELL, "", {widths[w], slopes[s], 1}};

				log = incise_mf_log(&bell, xs[i]);
				assert_true(isfinite(log) && log <= 0);
			}
		}
}

static void test_names(void **state)
{
	assert_int_equal(incise_mf_type_find("gaussmf"), INCISE_MF_GAUSS);
	assert_int_equal(incise_mf_type_find("gbellmf"), INCISE_MF_GBELL);
	assert_int_equal(incise_mf_type_find("trapmf"), -1);
	assert_string_equal(incise_mf_type_name(INCISE_MF_GBELL), "gbellmf");
}

static void test_valid(void **state)
{
	assert_true(incise_mf_valid(INCISE_MF_GAUSS, (double[]){1, 0}));
	assert_false(incise_mf_valid(INCISE_MF_GAUSS, (double[]){0, 0}));
	assert_false(incise_mf_valid(INCISE_MF_GAUSS, (double[]){1, NAN}));
	assert_false(incise_mf_valid(INCISE_MF_GBELL, (double[]){1, -1, 0}));
	assert_false(incise_mf_valid(INCISE_MF_GBELL, (double[]){1, 1, INFINITY}));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_degrees),
		cmocka_unit_test(test_log_is_always_a_number),
		cmocka_unit_test(test_names),
		cmocka_unit_test(test_valid),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
