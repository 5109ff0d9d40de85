// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Random order: a permutation, by seed, and fair.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>
#include "../../../lib/learn/shuffle.h"

static void test_is_a_permutation(void **state)
{
	for (size_t n = 0; n < 40; n++) {
		size_t order[40];
		int seen[40] = {0};

		incise_shuffle(order, n, n);
		for (size_t i = 0; i < n; i++) {
			assert_true(order[i] < n);
			assert_int_equal(seen[order[i]]++, 0);
		}
	}
}

static void test_depends_on_the_seed_only(void **state)
{
	size_t a[30], b[30];

	incise_shuffle(a, 30, 7);
	incise_shuffle(b, 30, 7);
	assert_memory_equal(a, b, sizeof(a));
	incise_shuffle(b, 30, 8);
	assert_memory_not_equal(a, b, sizeof(a));
}

/* Every item comes to every place equally often, within 5 sigma of a binomial. */
static void test_fair(void **state)
{
	const int rounds = 20000, n = 6;
	int count[6][6] = {0};
	double sigma = sqrt(rounds * (1.0 / n) * (1 - 1.0 / n));

	for (int r = 0; r < rounds; r++) {
		size_t order[6];

		incise_shuffle(order, n, r);
		for (int i = 0; i < n; i++)
			count[i][order[i]]++;
	}
	for (int i = 0; i < n * n; i++)
		assert_true(fabs(count[i / n][i % n] - rounds / (double)n) < 5 * sigma);
}

/* Uniform in [-1, 1): mean and variance within five standard errors, and by seed. */
static void test_random(void **state)
{
	uint64_t a = 5, b = 5;
	double mean = 0, square = 0;
	const int n = 100000;

	for (int i = 0; i < n; i++) {
		double x = incise_random(&a);

		assert_true(x >= -1 && x < 1);
		assert_true(x == incise_random(&b));
		mean += x / n;
		square += x * x / n;
	}
	assert_true(fabs(mean) < 5 * sqrt(1.0 / 3 / n));
	/* The variance of x² is 4/45. */
	assert_true(fabs(square - 1.0 / 3) < 5 * sqrt(4.0 / 45 / n));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_random),
		cmocka_unit_test(test_is_a_permutation),
		cmocka_unit_test(test_depends_on_the_seed_only),
		cmocka_unit_test(test_fair),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
