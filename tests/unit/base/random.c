// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/random.h: distributions, and independence of streams. The seeds are fixed, so
 * that a bound of 5 sd does not depend on luck.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/base/random.h"

#define N 200000

static void normal_moments(void **state)
{
	uint64_t key = incise_random_key(3, INCISE_RANDOM_FORCE);
	double sum[5] = {0};

	for (int i = 0; i < N; i++) {
		double x = incise_random_normal(key, i);

		assert_true(fabs(x) < 6.7);
		for (int k = 1; k < 5; k++)
			sum[k] += pow(x, k) / N;
	}
	/* sd of the mean of x^k over N: √(var(x^k)/N), var 1, 2, 15, 96. */
	assert_true(fabs(sum[1]) < 5 * sqrt(1.0 / N));
	assert_true(fabs(sum[2] - 1) < 5 * sqrt(2.0 / N));
	assert_true(fabs(sum[3]) < 5 * sqrt(15.0 / N));
	assert_true(fabs(sum[4] - 3) < 5 * sqrt(96.0 / N));
}

static void uniform_fills_its_range(void **state)
{
	uint64_t key = incise_random_key(3, INCISE_RANDOM_TOOTH);
	int bin[100] = {0};

	for (int i = 0; i < N; i++) {
		double x = incise_random_uniform(key, i);

		assert_true(x >= 0 && x < 1);
		bin[(int)(x * 100)]++;
	}
	/* Binomial counts of mean 2000: sd √(2000·0.99) = 44.5. */
	for (int k = 0; k < 100; k++)
		assert_true(fabs(bin[k] - 2000.0) < 5 * 44.5);
}

/* Correlation of two streams at a shift: sd 1/√N when they are independent. */
static double correlation(uint64_t a, uint64_t b, int shift)
{
	double sum = 0;

	for (int i = 0; i < N; i++)
		sum += incise_random_normal(a, i) * incise_random_normal(b, i + shift) /
		       N;
	return sum;
}

static void streams_are_independent(void **state)
{
	uint64_t force = incise_random_key(1, INCISE_RANDOM_FORCE);
	uint64_t tracker = incise_random_key(1, INCISE_RANDOM_TRACKER);
	uint64_t other = incise_random_key(2, INCISE_RANDOM_FORCE);

	for (int shift = 0; shift < 5; shift++) {
		assert_true(fabs(correlation(force, tracker, shift)) < 5 / sqrt(N));
		assert_true(fabs(correlation(force, other, shift)) < 5 / sqrt(N));
	}
	assert_true(fabs(correlation(force, force, 1)) < 5 / sqrt(N));
	assert_true(fabs(correlation(force, force, 0) - 1) < 5 * sqrt(2.0 / N));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(normal_moments),
		cmocka_unit_test(uniform_fills_its_range),
		cmocka_unit_test(streams_are_independent),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
