// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Least squares: exact answers, ridges against their closed forms, block borders,
 * failures, and the same bits from every instruction set. Includes the source, to reach
 * the kernels.
 */
#include "../unit.h"
#include <lapacke.h>
#include "../../../lib/base/random.h"
#include "../../../lib/learn/lsq.c"

static uint64_t seed;

static double uniform(void)
{
	incise_random_step(&seed);
	return (seed >> 11) * 0x1p-52 - 1;
}

/* Any number of rows, below, at and beyond the blocks, gives back the planted x. */
TEST(test_planted_solution)
{
	static const int rows[] = {7, 8, 9, 63, 64, 65, 128, 1000};
	const double planted[] = {1, -2, 3, 0.5, 0, 1e3, -1e-3};

	for (size_t k = 0; k < sizeof(rows) / sizeof(*rows); k++) {
		struct incise_lsq *lsq = incise_lsq_new(7, NULL);
		double x[7];

		seed = k + 1;
		for (int n = 0; n < rows[k]; n++) {
			double *row = incise_lsq_row(lsq), target = 0;

			for (int i = 0; i < 7; i++) {
				row[i] = uniform();
				target += row[i] * planted[i];
			}
			incise_lsq_add(lsq, target);
		}
		assert_int_equal(incise_lsq_solve(lsq, NULL, x), 0);
		/* Square random systems may have a condition of some thousands. */
		for (int i = 0; i < 7; i++)
			assert_true(fabs(x[i] - planted[i]) < 1e-8);
		incise_lsq_free(lsq);
	}
}

/* One unknown: x = Σat/(Σa²+λ). Several ridges from one factor, in any order. */
TEST(test_ridge)
{
	static const double ridges[] = {10, 0, 1e-6, 1e6, 10};
	struct incise_lsq *lsq = incise_lsq_new(1, NULL);
	double aa = 0, at = 0, x;

	seed = 5;
	for (int n = 0; n < 50; n++) {
		double a = uniform(), t = uniform();

		*incise_lsq_row(lsq) = a;
		aa += a * a;
		at += a * t;
		incise_lsq_add(lsq, t);
	}
	for (size_t i = 0; i < 5; i++) {
		struct incise_ridge ridge = {.ridge = ridges[i], .n = 1};

		assert_int_equal(incise_lsq_solve(lsq, &ridge, &x), 0);
		assert_true(fabs(x - at / (aa + ridges[i])) < 1e-13 * fabs(x));
	}
	incise_lsq_free(lsq);
}

/* Two equal columns: singular without ridge; with a little, the weight is shared. */
TEST(test_rank_deficient)
{
	struct incise_lsq *lsq = incise_lsq_new(2, NULL);
	struct incise_ridge little = {.ridge = 1e-6, .n = 2}, one = {.ridge = 1, .n = 2};
	double x[2], condition;

	for (int n = 0; n < 20; n++) {
		incise_lsq_row(lsq)[0] = incise_lsq_row(lsq)[1] = n;
		incise_lsq_add(lsq, 3 * n);
	}
	assert_int_equal(incise_lsq_solve(lsq, &little, x), 0);
	/* λ pulls by λ/Σa² ≈ 4e-10, over a singular value of 1e-3. */
	assert_true(fabs(x[0] - 1.5) < 1e-6 && fabs(x[1] - 1.5) < 1e-6);
	assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
	assert_true(condition > 1e14);
	incise_lsq_reset(lsq);
	assert_int_equal(incise_lsq_solve(lsq, NULL, x), -EDOM);
	assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
	assert_true(isinf(condition));
	/* Fewer rows than unknowns are fine with a ridge. */
	incise_lsq_row(lsq)[0] = 1;
	incise_lsq_row(lsq)[1] = 0;
	incise_lsq_add(lsq, 2);
	assert_int_equal(incise_lsq_solve(lsq, NULL, x), -EDOM);
	assert_int_equal(incise_lsq_solve(lsq, &one, x), 0);
	assert_true(fabs(x[0] - 1) < 1e-15 && x[1] == 0);
	incise_lsq_free(lsq);
}

/* Condition numbers of random matrices whose columns shrink, against LAPACK's. */
TEST(test_condition_of_lapack)
{
	static double a[80 * 80];
	double values[80], none, condition;

	seed = 7;
	for (int n = 1; n <= 80; n += 1 + n / 8)
		for (int grade = 0; grade < 12; grade += 3) {
			struct incise_lsq *lsq = incise_lsq_new(n, NULL);

			for (int k = 0; k < n; k++) {
				double *row = incise_lsq_row(lsq);

				for (int i = 0; i < n; i++)
					a[k * n + i] = row[i] =
						uniform() *
						pow(10, -(double)grade * i / n);
				incise_lsq_add(lsq, 0);
			}
			assert_int_equal(incise_lsq_condition(lsq, &condition), 0);
			assert_int_equal(LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'N', n, n, a, n,
							values, &none, 1, &none, 1),
					 0);
			/* LAPACK reads the transpose, whose singular values are the same; both err
			 * by some roundings of the largest value in the smallest */
			assert_true(fabs(condition * values[n - 1] / values[0] - 1) <=
				    8 * n * DBL_EPSILON * condition);
			incise_lsq_free(lsq);
		}
}

/* Squares that overflow or vanish are no obstacle; what is not finite is reported. */
TEST(test_extreme_sizes)
{
	static const double sizes[] = {1e-300, 1e-160, 1, 1e160, 1e300};
	struct incise_lsq *lsq = incise_lsq_new(2, NULL);
	double x[2];

	for (size_t s = 0; s < sizeof(sizes) / sizeof(*sizes); s++) {
		incise_lsq_reset(lsq);
		for (int n = 0; n < 10; n++) {
			incise_lsq_row(lsq)[0] = sizes[s] * (n + 1);
			incise_lsq_row(lsq)[1] = sizes[s] * (n % 3 - 1);
			incise_lsq_add(lsq, sizes[s] * (2 * (n + 1) - (n % 3 - 1)));
		}
		assert_int_equal(incise_lsq_solve(lsq, NULL, x), 0);
		assert_true(fabs(x[0] - 2) < 1e-13 && fabs(x[1] + 1) < 1e-13);
	}
	incise_lsq_row(lsq)[0] = INFINITY;
	incise_lsq_row(lsq)[1] = 0;
	incise_lsq_add(lsq, 1);
	assert_int_equal(incise_lsq_solve(lsq, NULL, x), -EDOM);
	incise_lsq_free(lsq);
}

/* Rows of √factor·(p_a - p_b), or of √factor·p_a without b, for both parameters of rules. */
static void add_difference(struct incise_lsq *lsq, int n, int a, int b, double factor)
{
	for (int c = 0; c < 2; c++) {
		double *row = incise_lsq_row(lsq);

		for (int k = 0; k < n; k++)
			row[k] = sqrt(factor) *
				 ((k == 2 * a + c) - (b >= 0 && k == 2 * b + c));
		incise_lsq_add(lsq, 0);
	}
}

/* The ridge on a grid of rules against the same penalty written out as rows. */
TEST(test_ridge_of_a_grid)
{
	static const struct {
		double mean;
		int n_mfs[2];
	} cases[] = {{1, {1}}, {1, {5}}, {0.25, {3, 2}}, {1e-3, {2, 3}}, {1e-3, {1, 4}}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int m = cases[i].n_mfs[1] ? cases[i].n_mfs[1] : 1,
		    rules = cases[i].n_mfs[0] * m, n = 2 * rules;
		struct incise_lsq *a = incise_lsq_new(n, NULL),
				  *b = incise_lsq_new(n, NULL);
		struct incise_ridge ridge = {.ridge = 0.7,
					     .n = n,
					     .mean = cases[i].mean,
					     .n_mfs = {cases[i].n_mfs[0],
						       cases[i].n_mfs[1]}};
		double x[12], y[12];

		seed = i;
		for (int row = 0; row < 7; row++) {
			double t = uniform();

			for (int k = 0; k < n; k++)
				incise_lsq_row(a)[k] = incise_lsq_row(b)[k] = uniform();
			incise_lsq_add(a, t);
			incise_lsq_add(b, t);
		}
		for (int r = 0; r < rules; r++) {
			if (r + m < rules)
				add_difference(b, n, r, r + m, 0.7);
			if (r % m < m - 1)
				add_difference(b, n, r, r + 1, 0.7);
		}
		for (int c = 0; c < 2; c++) {
			for (int k = 0; k < n; k++)
				incise_lsq_row(b)[k] =
					k % 2 == c ? sqrt(cases[i].mean / rules) : 0;
			incise_lsq_add(b, 0);
		}
		assert_int_equal(incise_lsq_solve(a, &ridge, x), 0);
		assert_int_equal(incise_lsq_solve(b, NULL, y), 0);
		/* Rounding, times the square of a condition of √(1/1e-3) at most. */
		for (int k = 0; k < n; k++)
			assert_true(fabs(x[k] - y[k]) < 1e-11);
		incise_lsq_free(a);
		incise_lsq_free(b);
	}
}

/* |R⁻ᵀa|² = aᵀ(AᵀA)⁻¹a, which for a row of orthogonal columns is Σ a²/|column|². */
TEST(test_leverage)
{
	struct incise_lsq *lsq = incise_lsq_new(3, NULL);
	double a[] = {1, 2, 3};
	const double *factor;
	int stride;

	for (int n = 0; n < 3; n++) {
		for (int i = 0; i < 3; i++)
			incise_lsq_row(lsq)[i] = i == n ? 2 * (n + 1) : 0;
		incise_lsq_add(lsq, 1);
	}
	factor = incise_lsq_factor(lsq, NULL, &stride);
	assert_non_null(factor);
	assert_true(fabs(incise_lsq_leverage(factor, stride, 3, a) - 0.75) < 1e-15);
	incise_lsq_free(lsq);
}

/* The vector kernel and the plain one do the same operations in the same order. */
TEST(test_same_bits_everywhere)
{
#ifdef __x86_64__
	_Alignas(32) double r[2][92], a[2][BLOCK * 92];
	double v[BLOCK];

	if (!__builtin_cpu_supports("avx2"))
		skip();
	for (int stride = 4; stride <= 92; stride += 8)
		for (int rows = 1; rows <= BLOCK; rows += 7) {
			seed = stride * 100 + rows;
			for (int k = 0; k < stride; k++)
				r[0][k] = r[1][k] = uniform();
			for (int k = 0; k < rows * stride; k++)
				a[0][k] = a[1][k] = uniform();
			for (int k = 0; k < rows; k++)
				v[k] = uniform();
			reflect_plain(r[0], a[0], stride, 0, v, rows, 1.3);
			reflect_avx2(r[1], a[1], stride, 0, v, rows, 1.3);
			assert_memory_equal(r[0], r[1], stride * sizeof(double));
			assert_memory_equal(a[0], a[1], rows * stride * sizeof(double));
		}
#else
	skip();
#endif
}
