// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Limits: force, slew, and nothing but numbers.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <float.h>
#include <math.h>
#include "../../../lib/tissue/limit.h"

static void test_force_and_slew(void **state)
{
	static const struct {
		double asked, rendered;
		bool held;
	} steps[] = {
		{0.3, 0.3, false}, {0.9, 0.8, true}, {0.9, 0.9, false}, {9, 1.4, true},
		{9, 1.9, true},	   {9, 2, true},     {9, 2, true},	{-9, 1.5, true},
		{1.2, 1.2, false}, {0, 0.7, true},   {0, 0.2, true},	{0, 0, false},
	};
	struct incise_limit limit = {.force_N = 2, .slew_N = 0.5};

	for (size_t i = 0; i < sizeof(steps) / sizeof(*steps); i++) {
		bool held;
		double force = incise_limit_apply(&limit, steps[i].asked, &held);

		assert_true(fabs(force - steps[i].rendered) < 1e-12);
		assert_int_equal(held, steps[i].held);
	}
}

static void test_whatever_is_asked(void **state)
{
	static const double hostile[] = {NAN,	  INFINITY, -INFINITY,
					 DBL_MAX, -DBL_MAX, 5e-324};
	struct incise_limit limit = {.force_N = 2, .slew_N = 0.5};

	for (int i = 0; i < 6000; i++) {
		double last = limit.last_N;
		bool held;
		double force = incise_limit_apply(&limit, hostile[i * 7919 % 6], &held);

		assert_true(fabs(force) <= 2);
		assert_true(fabs(force - last) <= 0.5 + 1e-12);
	}
}

/* A number that is none asks for nothing, and says so. */
static void test_nan_is_no_force(void **state)
{
	struct incise_limit limit = {.force_N = 2, .slew_N = 5};
	bool held;

	incise_limit_apply(&limit, 1, &held);
	assert_true(incise_limit_apply(&limit, NAN, &held) == 0);
	assert_true(held);
}

static void test_zero_is_at_once(void **state)
{
	struct incise_limit limit = {.force_N = 2, .slew_N = 0.1, .last_N = 1.5};
	bool held;

	incise_limit_zero(&limit);
	assert_true(incise_limit_apply(&limit, 0, &held) == 0);
	assert_false(held);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_force_and_slew),
		cmocka_unit_test(test_whatever_is_asked),
		cmocka_unit_test(test_nan_is_no_force),
		cmocka_unit_test(test_zero_is_at_once),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
