// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Training pairs: what is refused, a random part of them, R².
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../../../lib/learn/pairs.h"

static void test_refusals(void **state)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 1},
						    {"velocity_mm_s", 0, 1}};
	double rows[30];
	struct incise_pairs pairs = {rows, 10, 2}, few = {rows, 4, 2},
			    none = {rows, 0, 2};
	struct incise_error err = {0};

	for (int i = 0; i < 30; i++)
		rows[i] = i;
	assert_int_equal(incise_pairs_check(&pairs, "training", &err), 0);
	assert_int_equal(incise_pairs_check_inputs(&pairs, in, &err), 0);
	assert_int_equal(incise_pairs_check(&none, "check", &err), -EINVAL);
	assert_non_null(strstr(err.text, "no check pairs"));
	assert_int_equal(incise_pairs_check_inputs(&few, in, &err), -ENODATA);
	rows[14] = INFINITY;
	assert_int_equal(incise_pairs_check(&pairs, "training", &err), -EINVAL);
	assert_non_null(strstr(err.text, "training pair 5 "));
	for (int i = 0; i < 10; i++)
		rows[3 * i + 1] = 7;
	assert_int_equal(incise_pairs_check_inputs(&pairs, in, &err), -EINVAL);
	assert_non_null(strstr(err.text, "velocity_mm_s is constant, 7"));
}

/* Each pair at most once, in order, with its group; all of them where there is room. */
static void test_sample(void **state)
{
	static double rows[2000];
	static int groups[1000];
	struct incise_pairs pairs = {rows, 1000, 1};
	struct incise_scaling scaling = {1, {0, 0}, {1, 1}};

	for (int i = 0; i < 1000; i++) {
		rows[2 * i] = i;
		groups[i] = i / 10;
	}
	for (size_t most = 10; most <= 100000; most *= 100) {
		struct incise_sample a = {0}, b = {0}, c = {0};
		size_t n = most < 1000 ? most : 1000;

		assert_int_equal(
			incise_sample_take(&a, &scaling, &pairs, groups, most, 1), 0);
		assert_int_equal(incise_sample_take(&b, &scaling, &pairs, NULL, most, 1),
				 0);
		assert_int_equal(incise_sample_take(&c, &scaling, &pairs, NULL, most, 2),
				 0);
		assert_int_equal(a.pairs.n, n);
		for (size_t i = 0; i < n; i++) {
			if (i)
				assert_true(a.rows[2 * i] > a.rows[2 * i - 2]);
			assert_int_equal(a.groups[i], (int)a.rows[2 * i] / 10);
		}
		assert_memory_equal(a.rows, b.rows, n * 2 * sizeof(double));
		assert_int_equal(!memcmp(a.rows, c.rows, n * 2 * sizeof(double)),
				 most >= 1000);
		assert_null(b.groups);
		incise_sample_free(&a);
		incise_sample_free(&b);
		incise_sample_free(&c);
	}
}

static void test_r2(void **state)
{
	static const double sizes[] = {1e-200, 1, 1e200};

	for (int s = 0; s < 3; s++) {
		double rows[] = {0, 1 * sizes[s], 0, 2 * sizes[s], 0, 3 * sizes[s]};
		struct incise_pairs pairs = {rows, 3, 1};

		/* The variance is 2/3. */
		assert_true(fabs(incise_pairs_r2(&pairs, sizes[s]) + 0.5) < 1e-14);
		assert_true(incise_pairs_r2(&pairs, 0) == 1);
		rows[1] = rows[3] = rows[5] = 0.1 * sizes[s];
		assert_true(isnan(incise_pairs_r2(&pairs, 0)));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_sample),
		cmocka_unit_test(test_r2),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
