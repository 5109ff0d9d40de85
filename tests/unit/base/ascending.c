// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/ascending.h: the median of odd and even counts.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include "../../../lib/base/ascending.h"

static void test_median(void **state)
{
	double odd[] = {5, -1, 3}, even[] = {4, 1, 3, 2}, one[] = {7};

	assert_true(median(odd, 3) == 3);
	assert_true(median(even, 4) == 2.5);
	assert_true(median(one, 1) == 7);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_median),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
