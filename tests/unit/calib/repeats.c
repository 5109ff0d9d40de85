// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/repeats.c: medians, a standard deviation that bears outliers, and the
 * uncertainty of a mean.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>
#include "../../../lib/calib/repeats.h"

static void test_median(void **state)
{
	double odd[] = {5, -1, 3}, even[] = {4, 1, 3, 2}, one[] = {7};

	assert_true(repeats_median(odd, 3) == 3);
	assert_true(repeats_median(even, 4) == 2.5);
	assert_true(repeats_median(one, 1) == 7);
}

/* Quantiles of a normal distribution, of sd 1: the table is exact but for its steps. */
static void test_sd(void **state)
{
	double absolute[1000];

	for (int spoilt = 0; spoilt <= 250; spoilt += 250) {
		for (int i = 0; i < 1000; i++) {
			double low = 0, high = 10, p = (i + 0.5) / 1000;

			/* erf(x/√2) is the share within x */
			for (int k = 0; k < 60; k++) {
				double middle = (low + high) / 2;

				*(erf(middle / M_SQRT2) < p ? &low : &high) = middle;
			}
			absolute[i] = i < spoilt ? 1e6 : low;
		}
		if (!spoilt)
			/* 1.2 % is what is added for 1000 */
			assert_true(fabs(repeats_sd(absolute, 1000) / 1.012 - 1) < 0.01);
		else
			/* a quarter of them gone: the median of the rest is higher up */
			assert_true(repeats_sd(absolute, 1000) < 3);
	}
}

/* Two values ± 1: sd √2, over √2; and Student's 13.97 over 2 for one degree of freedom. */
static void test_two(void **state)
{
	const double residual[] = {1, -1};
	int effective;

	assert_true(fabs(repeats_u(residual, 2, 1, &effective) - 13.97 / 2) < 1e-12);
	assert_int_equal(effective, 2);
	assert_true(repeats_u(residual, 1, 1, &effective) == 0);
	assert_int_equal(effective, 1);
}

/* Each value five times: a fifth of them count, which is √5 in the uncertainty. */
static void test_correlated(void **state)
{
	double apart[200], alike[1000], u;
	uint64_t seed = 1;
	int effective;

	for (int i = 0; i < 200; i++) {
		seed = seed * 6364136223846793005u + 1442695040888963407u;
		apart[i] = (seed >> 11) * 0x1p-52 - 1;
		for (int k = 0; k < 5; k++)
			alike[5 * i + k] = apart[i];
	}
	u = repeats_u(apart, 200, 1, &effective);
	assert_int_equal(effective, 200);
	/* the correlation is itself an estimate: to a fifth */
	assert_true(fabs(repeats_u(alike, 1000, 1, &effective) / u - 1) < 0.2);
	assert_in_range(effective, 140, 280);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_median),
		cmocka_unit_test(test_sd),
		cmocka_unit_test(test_two),
		cmocka_unit_test(test_correlated),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
