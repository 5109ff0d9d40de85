// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The search for the steepest secant, on slopes that are written down: many hills of
 * which one is the highest, in a corner, in one to eight dimensions.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/model/secant.h"

#define N_POINTS 4096

struct hills {
	int n;
	int *asked;
};

/*
 * Waves whose crests rise towards the upper corner; -1 … 1 times the number of inputs,
 * and that only at the ends.
 */
static double slope(const void *of, const double *x, int i)
{
	const struct hills *hills = of;
	double sum = 0;

	++*hills->asked;
	for (int k = 0; k < hills->n; k++) {
		assert_true(x[k] >= -1 && x[k] <= 3);
		sum += 0.8 * cos(M_PI * (x[k] + 1)) * (k == i ? 1 : 0.1) +
		       0.1 * (x[k] - 1);
	}
	return sum;
}

static void test_finds_the_highest_hill(void **state)
{
	for (int n = 1; n <= INCISE_MODEL_INPUTS_MAX; n++) {
		struct incise_slope slopes[INCISE_MODEL_INPUTS_MAX];
		int asked = 0;
		struct hills hills = {n, &asked};
		struct incise_secant secant = {.of = &hills,
					       .n_inputs = n,
					       .n_points = N_POINTS,
					       .slope = slope};
		/* At 3 in every input: cos 4π, and the rise of 0.1·2. */
		double highest = 0.8 + 0.08 * (n - 1) + 0.2 * n;

		for (int i = 0; i < n; i++) {
			secant.min[i] = -1;
			secant.max[i] = 3;
		}
		incise_secant_search(&secant, slopes);
		/* Bounded work: points, and climbs of both ends, each with a last round. */
		assert_true(asked <= n * (2 * N_POINTS + 8 * 2 * n));
		for (int i = 0; i < n; i++) {
			assert_false(slopes[i].certified);
			assert_true(slopes[i].highest <= highest + 1e-12);
			/* A few inputs are searched well; of eight, 4096 points see little. */
			assert_true(slopes[i].highest >
				    highest - (n <= 3 ? 0.005 : 0.2 * n));
			assert_true(slopes[i].lowest < -0.8);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_finds_the_highest_hill),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
