// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Enclosures hold what they enclose: interval operations on random numbers, and the
 * degrees' derivatives against differences in long double.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/model/axis.h"
#include "paper_model.h"

static bool holds(struct interval a, long double x)
{
	return a.lo <= x && x <= a.hi;
}

/* Long double sees what outward rounding has to make room for. */
static void test_operations(void **state)
{
	uint64_t seed = 1;

	for (int n = 0; n < 100000; n++) {
		double v[4], scale = pow(10, 6 * paper_random(&seed));
		struct interval a, b;
		long double x, y;

		for (int i = 0; i < 4; i++)
			v[i] = scale * paper_random(&seed);
		a = (struct interval){fmin(v[0], v[1]), fmax(v[0], v[1])};
		b = (struct interval){fmin(v[2], v[3]), fmax(v[2], v[3])};
		x = n % 3 ? (long double)v[0] : a.lo + (a.hi - a.lo) * 0.3L;
		y = n % 2 ? (long double)v[2] : b.lo + (b.hi - b.lo) * 0.7L;
		x = fmaxl(a.lo, fminl(a.hi, x));
		y = fmaxl(b.lo, fminl(b.hi, y));
		assert_true(holds(iv_add(a, b), x + y));
		assert_true(holds(iv_sub(a, b), x - y));
		assert_true(holds(iv_mul(a, b), x * y));
		assert_true(holds(iv_square(a), x * x));
		if (a.lo > 0)
			assert_true(holds(iv_inverse(a), 1 / x));
		if (scale < 100)
			assert_true(holds(iv_exp(a), expl(x)));
	}
}

static void test_extremes(void **state)
{
	/* Overflow opens the interval, it does not lose it. */
	assert_true(isinf(iv_exp(iv(1000)).hi));
	assert_true(iv_exp(iv(-1000)).lo >= 0 && iv_exp(iv(-1000)).hi > 0);
	assert_true(iv_add(iv(0), iv(0)).lo < 0 && iv_add(iv(0), iv(0)).hi > 0);
}

/* Derivatives by symmetric differences of the degrees. */
static void test_degrees_over_an_interval(void **state)
{
	for (uint64_t seed = 1; seed <= 20; seed++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, seed, 1);
		struct incise_axis axis;
		uint64_t points = seed;

		paper_disturb(model, seed, 0.6);
		incise_axis_init(&axis, model, seed % 2);
		for (int n = 0; n < 300; n++) {
			double u = (paper_random(&points) + 1) / 2;
			double at = axis.min + (axis.max - axis.min) * u;
			double half = (axis.max - axis.min) * pow(10, -1 - 3 * (n % 4));
			struct interval x = {at - half, at + half};
			struct incise_axis_range range;
			long double a[3][INCISE_FIXED_MFS_MAX], h = 1e-4L, sum = 0;

			incise_axis_over(&axis, x, &range);
			at += half * 0.9 * paper_random(&points);
			for (int k = 0; k < 3; k++)
				incise_axis_at(&axis, at + (k - 1) * h, a[k]);
			for (int i = 0; i < axis.n; i++) {
				/* Differences are off by h² times higher derivatives (of order
				 * 1), and by rounding of 1e-19/h². */
				long double d1 = (a[2][i] - a[0][i]) / (2 * h);
				long double d2 =
					(a[2][i] - 2 * a[1][i] + a[0][i]) / (h * h);

				assert_true(holds(range.a[i], a[1][i]));
				assert_true(range.d1[i].lo - 1e-7 <= d1 &&
					    d1 <= range.d1[i].hi + 1e-7);
				assert_true(range.d2[i].lo - 1e-6 <= d2 &&
					    d2 <= range.d2[i].hi + 1e-6);
				/* And they are tight where the interval is narrow. */
				if (n % 4 == 3)
					assert_true(range.a[i].hi - range.a[i].lo < 1e-7);
				sum += a[1][i];
			}
			assert_true(fabsl(sum - 1) < 1e-17L);
		}
		incise_model_free(model);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_operations),
		cmocka_unit_test(test_extremes),
		cmocka_unit_test(test_degrees_over_an_interval),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
