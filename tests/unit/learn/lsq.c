// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Least squares: exact answers, ridge against its closed form, block borders, failures.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include "../../../lib/learn/lsq.h"

static uint64_t seed;

static double uniform(void)
{
	seed = seed * 6364136223846793005u + 1442695040888963407u;
	return (seed >> 11) * 0x1p-52 - 1;
}

/* Any number of rows, below, at and beyond the blocks, gives back the planted x. */
static void test_planted_solution(void **state)
{
	static const int rows[] = {7, 8, 9, 35, 36, 37, 100, 1000};
	const double planted[] = {1, -2, 3, 0.5, 0, 1e3, -1e-3};

	for (size_t k = 0; k < sizeof(rows) / sizeof(*rows); k++) {
		struct incise_lsq *lsq = incise_lsq_new(7);
		double x[7];

		seed = k + 1;
		for (int n = 0; n < rows[k]; n++) {
			double *row = incise_lsq_row(lsq), target = 0;

			for (int i = 0; i < 7; i++) {
				row[i] = uniform();
				target += row[i] * planted[i];
			}
			assert_int_equal(incise_lsq_add(lsq, target), 0);
		}
		assert_int_equal(incise_lsq_solve(lsq, 0, x), 0);
		/* Square random systems may have a condition of some thousands. */
		for (int i = 0; i < 7; i++)
			assert_true(fabs(x[i] - planted[i]) < 1e-8);
		incise_lsq_free(lsq);
	}
}

/* One unknown: x = Σat/(Σa²+λ). Several ridges from one factor, in any order. */
static void test_ridge(void **state)
{
	static const double ridges[] = {10, 0, 1e-6, 1e6, 10};
	struct incise_lsq *lsq = incise_lsq_new(1);
	double aa = 0, at = 0, x;

	seed = 5;
	for (int n = 0; n < 50; n++) {
		double a = uniform(), t = uniform();

		*incise_lsq_row(lsq) = a;
		aa += a * a;
		at += a * t;
		assert_int_equal(incise_lsq_add(lsq, t), 0);
	}
	for (size_t i = 0; i < 5; i++) {
		assert_int_equal(incise_lsq_solve(lsq, ridges[i], &x), 0);
		assert_true(fabs(x - at / (aa + ridges[i])) < 1e-13 * fabs(x));
	}
	incise_lsq_free(lsq);
}

/* Two equal columns: singular without ridge; with a little, the weight is shared. */
static void test_rank_deficient(void **state)
{
	struct incise_lsq *lsq = incise_lsq_new(2);
	double x[2], condition;

	for (int n = 0; n < 20; n++) {
		incise_lsq_row(lsq)[0] = incise_lsq_row(lsq)[1] = n;
		incise_lsq_add(lsq, 3 * n);
	}
	assert_int_equal(incise_lsq_solve(lsq, 1e-6, x), 0);
	/* λ pulls by λ/Σa² ≈ 4e-10, over a singular value of 1e-3. */
	assert_true(fabs(x[0] - 1.5) < 1e-6 && fabs(x[1] - 1.5) < 1e-6);
	assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
	assert_true(condition > 1e14);
	incise_lsq_reset(lsq);
	assert_int_equal(incise_lsq_solve(lsq, 0, x), -EDOM);
	assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
	assert_true(isinf(condition));
	/* Fewer rows than unknowns are fine with a ridge. */
	incise_lsq_row(lsq)[0] = 1;
	incise_lsq_row(lsq)[1] = 0;
	incise_lsq_add(lsq, 2);
	assert_int_equal(incise_lsq_solve(lsq, 0, x), -EDOM);
	assert_int_equal(incise_lsq_solve(lsq, 1, x), 0);
	assert_true(fabs(x[0] - 1) < 1e-15 && x[1] == 0);
	incise_lsq_free(lsq);
}

static void test_condition(void **state)
{
	struct incise_lsq *lsq = incise_lsq_new(3);
	double condition;

	for (int n = 0; n < 3; n++) {
		for (int i = 0; i < 3; i++)
			incise_lsq_row(lsq)[i] = i == n ? pow(10, n) : 0;
		incise_lsq_add(lsq, 1);
	}
	assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
	assert_true(fabs(condition - 100) < 1e-12 * 100);
	incise_lsq_free(lsq);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_planted_solution),
		cmocka_unit_test(test_ridge),
		cmocka_unit_test(test_rank_deficient),
		cmocka_unit_test(test_condition),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
