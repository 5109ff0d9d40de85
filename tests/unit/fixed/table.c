// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The arithmetic by tables of weights: exact at knots, convergent with cells.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include "interpolated.h"

static void test_exact_at_knots(void **state)
{
	exact_at_knots(INCISE_FIXED_TABLE);
}

static void test_error_falls_with_the_square(void **state)
{
	error_falls_with_the_square(INCISE_FIXED_TABLE);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_exact_at_knots),
		cmocka_unit_test(test_error_falls_with_the_square),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
