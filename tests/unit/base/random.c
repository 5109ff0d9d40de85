// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/random.h: distributions, and independence of streams. The seeds are fixed, so
 * that a bound of 5 sd does not depend on luck.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"

#define N 200000

TEST(normal_moments)
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

TEST(uniform_fills_its_range)
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

TEST(streams_are_independent)
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

TEST(test_is_a_permutation)
{
	for (size_t n = 0; n < 40; n++) {
		size_t order[40];
		int seen[40] = {0};

		incise_random_shuffle(order, n, n);
		for (size_t i = 0; i < n; i++) {
			assert_true(order[i] < n);
			assert_int_equal(seen[order[i]]++, 0);
		}
	}
}

TEST(test_depends_on_the_seed_only)
{
	size_t a[30], b[30];

	incise_random_shuffle(a, 30, 7);
	incise_random_shuffle(b, 30, 7);
	assert_memory_equal(a, b, sizeof(a));
	incise_random_shuffle(b, 30, 8);
	assert_memory_not_equal(a, b, sizeof(a));
}

/* Every item comes to every place equally often, within 5 sigma of a binomial. */
TEST(test_fair)
{
	const int rounds = 20000, n = 6;
	int count[6][6] = {0};
	double sigma = sqrt(rounds * (1.0 / n) * (1 - 1.0 / n));

	for (int r = 0; r < rounds; r++) {
		size_t order[6];

		incise_random_shuffle(order, n, r);
		for (int i = 0; i < n; i++)
			count[i][order[i]]++;
	}
	for (int i = 0; i < n * n; i++)
		assert_true(fabs(count[i / n][i % n] - rounds / (double)n) < 5 * sigma);
}

/* Uniform in [-1, 1): mean and variance within five standard errors, and by seed. */
TEST(test_random)
{
	uint64_t a = 5, b = 5;
	double mean = 0, square = 0;
	const int n = 100000;

	for (int i = 0; i < n; i++) {
		double x = incise_random_symmetric(&a);

		assert_true(x >= -1 && x < 1);
		assert_true(x == incise_random_symmetric(&b));
		mean += x / n;
		square += x * x / n;
	}
	assert_true(fabs(mean) < 5 * sqrt(1.0 / 3 / n));
	/* The variance of x² is 4/45. */
	assert_true(fabs(square - 1.0 / 3) < 5 * sqrt(4.0 / 45 / n));
}
