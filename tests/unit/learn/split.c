// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Keeping rows back: the share, whole groups, both sides filled.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <incise/train.h>

static void test_rows(void **state)
{
	bool check[120];
	int n = 0;

	/* The paper's halves: just 60 of 120. */
	assert_int_equal(incise_split(120, NULL, 0.5, 1, check, NULL), 0);
	for (int i = 0; i < 120; i++)
		n += check[i];
	assert_int_equal(n, 60);
}

static void test_groups_stay_whole(void **state)
{
	for (uint64_t seed = 0; seed < 50; seed++) {
		int groups[500], side[20], n = 0;
		bool check[500];

		/* 20 groups of 5 to 45 rows. */
		for (int i = 0; i < 20; i++)
			side[i] = -1;
		for (int i = 0; i < 500; i++)
			groups[i] = (int)sqrt(i * 0.8);
		assert_int_equal(incise_split(500, groups, 0.3, seed, check, NULL), 0);
		for (int i = 0; i < 500; i++) {
			n += check[i];
			if (side[groups[i]] < 0)
				side[groups[i]] = check[i];
			assert_int_equal(side[groups[i]], check[i]);
		}
		/* Off by less than half of the largest group. */
		assert_true(abs(n - 150) <= 25);
	}
}

static void test_both_sides_keep_something(void **state)
{
	const int groups[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1};

	for (uint64_t seed = 0; seed < 20; seed++)
		for (int s = 1; s < 10; s++) {
			bool check[10];
			int n = 0;

			assert_int_equal(
				incise_split(10, groups, s / 10.0, seed, check, NULL), 0);
			for (int i = 0; i < 10; i++)
				n += check[i];
			assert_true(n == 1 || n == 9);
		}
}

static void test_refusals(void **state)
{
	const int one[] = {0, 0, 0};
	bool check[3];
	struct incise_error err = {0};

	assert_int_equal(incise_split(3, one, 0.5, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(1, NULL, 0.5, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, 0, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, 1, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, NAN, 1, check, &err), -EINVAL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_rows),
		cmocka_unit_test(test_groups_stay_whole),
		cmocka_unit_test(test_both_sides_keep_something),
		cmocka_unit_test(test_refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
