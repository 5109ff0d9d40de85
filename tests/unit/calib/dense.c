// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Small symmetric matrices, against LAPACK: random ones of all sizes, of any condition, and those
 * with equal eigenvalues or none.
 */
#include "../unit.h"
#include <float.h>
#include <lapacke.h>
#include "../../../lib/base/random.h"
#include "../../../lib/calib/dense.h"

#define MAX 60

static uint64_t seed;

static double uniform(void)
{
	incise_random_step(&seed);
	return (seed >> 11) * 0x1p-52 - 1;
}

/* BᵀB + shift, B of n columns that shrink by a factor of `grade` each, and of few rows: its rank. */
static void fill(double *a, int n, int rank, double grade, double shift)
{
	memset(a, 0, (size_t)n * n * sizeof(*a));
	for (int row = 0; row < rank; row++) {
		double b[MAX];

		for (int i = 0; i < n; i++)
			b[i] = uniform() * pow(grade, i);
		for (int i = 0; i < n; i++)
			for (int k = 0; k < n; k++)
				a[i * n + k] += b[i] * b[k];
	}
	for (int i = 0; i < n; i++)
		a[i * n + i] += shift;
}

/* Eigenvalues are LAPACK's; A V = V Λ and VᵀV = 1, to some units of the last place of the largest. */
static void compare_eigen(const double *a, int n)
{
	double v[81], lapack[81], values[9], expected[9], limit;

	memcpy(v, a, (size_t)n * n * sizeof(*a));
	memcpy(lapack, a, (size_t)n * n * sizeof(*a));
	for (int i = 0; i < n; i++) /* only the lower triangle is read */
		for (int k = i + 1; k < n; k++)
			v[i * n + k] = NAN;
	incise_eigen(v, n, values);
	assert_int_equal(
		LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'L', n, lapack, n, expected), 0);
	limit = 8 * n * DBL_EPSILON;
	for (int k = 0; k < n; k++) {
		assert_true(fabs(values[k] - expected[k]) <= limit * expected[n - 1]);
		for (int i = 0; i < n; i++) {
			double product = 0, dot = 0;

			for (int j = 0; j < n; j++) {
				product += a[i * n + j] * v[j * n + k];
				dot += v[j * n + i] * v[j * n + k];
			}
			assert_true(fabs(product - values[k] * v[i * n + k]) <=
				    limit * expected[n - 1]);
			assert_true(fabs(dot - (i == k)) <= limit);
		}
	}
}

TEST(test_eigen)
{
	static const double grades[] = {1, 0.1, 1e-3};
	double a[81];

	seed = 1;
	for (int n = 1; n <= 9; n++)
		for (int rank = 0; rank <= n + 2; rank++)
			for (int g = 0; g < 3; g++) {
				fill(a, n, rank, grades[g], 0);
				compare_eigen(a, n);
				/* n - rank eigenvalues are equal */
				fill(a, n, rank, grades[g], 1);
				compare_eigen(a, n);
			}
}

/* The residual of a solution is rounding, whatever the condition; LAPACK agrees by the condition. */
TEST(test_cholesky)
{
	static double a[MAX * MAX], l[MAX * MAX], lapack[MAX * MAX];
	static const double shifts[] = {1, 1e-3, 1e-6};

	seed = 2;
	for (int n = 1; n <= MAX; n++)
		for (int s = 0; s < 3; s++) {
			double x[MAX], y[MAX], right[MAX], size = 0, norm = 0, trace = 0;

			fill(a, n, n, 1, shifts[s]);
			memcpy(l, a, sizeof(a));
			memcpy(lapack, a, sizeof(a));
			for (int i = 0; i < n; i++) {
				x[i] = y[i] = right[i] = uniform();
				trace += a[i * n + i];
				for (int k = i + 1; k < n; k++)
					l[i * n + k] = NAN;
			}
			assert_true(incise_cholesky(l, n));
			incise_cholesky_solve(l, n, x);
			assert_int_equal(LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', n, 1,
						       lapack, n, y, 1),
					 0);
			for (int i = 0; i < n; i++) {
				size = fmax(size, fabs(x[i]));
				norm = fmax(norm, fabs(x[i] - y[i]));
			}
			/* Higham, Accuracy and Stability, theorem 10.4: 3n+1 units, the norm is
			 * at most the trace; the condition trace/shift at most */
			assert_true(norm <=
				    8 * n * DBL_EPSILON * n * size * trace / shifts[s]);
			for (int i = 0; i < n; i++) {
				double rest = -right[i];

				for (int k = 0; k < n; k++)
					rest += a[i * n + k] * x[k];
				assert_true(fabs(rest) <=
					    4 * n * DBL_EPSILON * n * trace * size);
			}
		}
}

/* No factor of what is not positive definite, or not finite. */
TEST(test_refused)
{
	static const double cases[][4] = {
		{0, 0, 0, 1},	{1, 0, 0, -1},	{1, 0, 2, 1},	     {1, 0, 1, 1},
		{NAN, 0, 0, 1}, {1, 0, NAN, 1}, {INFINITY, 0, 0, 1},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double a[4];

		memcpy(a, cases[i], sizeof(a));
		assert_false(incise_cholesky(a, 2));
	}
}
