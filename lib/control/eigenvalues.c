// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Eigenvalues; see eigenvalues.h.
 *
 *        x x x x x x            x x x x x x      Hessenberg, whose diagonal falls apart into
 *        x x x x x x            x x x x x x      blocks of one or two, from the end on
 *   lo ──▶ 0 x x x x x     ──▶      . x x x x
 *            x x x x              b b x x x      b: the bulge, which a step chases from lo to hi
 *   hi ──▶     x x x              b b b x x
 */
#include <float.h>
#include <math.h>
#include "eigenvalues.h"

#define AT(i, j) a[(i)*n + (j)]
#define STEPS_MOST 60 /* for an eigenvalue */

static void swap(double *x, double *y)
{
	double t = *x;

	*x = *y;
	*y = t;
}

/* By elimination, with the largest pivot. */
static void make_hessenberg(double *a, int n)
{
	for (int m = 1; m < n - 1; m++) {
		int pivot = m;

		for (int i = m + 1; i < n; i++)
			if (fabs(AT(i, m - 1)) > fabs(AT(pivot, m - 1)))
				pivot = i;
		for (int j = 0; j < n && pivot != m; j++)
			swap(&AT(pivot, j), &AT(m, j));
		for (int i = 0; i < n && pivot != m; i++)
			swap(&AT(i, pivot), &AT(i, m));
		for (int i = m + 1; i < n && AT(m, m - 1) != 0; i++) {
			double part = AT(i, m - 1) / AT(m, m - 1);
			double *to = &AT(i, 0), *of = &AT(m, 0);

			if (part == 0)
				continue;
			for (int j = m - 1; j < n; j++)
				to[j] -= part * of[j];
			for (double *row = a; row < a + n * n; row += n)
				row[m] += part * row[i];
			AT(i, m - 1) = 0;
		}
	}
}

/* Reflect three numbers that are so far @apart, or the first two. */
static void reflect_three(double *x, int apart, int size, const double w[3], double scale)
{
	double none = 0, *y = x + apart, *z = size > 2 ? y + apart : &none;
	double sum = scale * (w[0] * *x + w[1] * *y + w[2] * *z);

	*x -= sum * w[0];
	*y -= sum * w[1];
	*z -= sum * w[2];
}

/* Reflect rows, then columns, from @k on, of the block, so that (p, q, r) becomes (s, 0, 0). */
static void reflect(double *a, int n, int lo, int hi, int k, const double v[3])
{
	int size = hi - k < 2 ? 2 : 3, from = k > lo ? k - 1 : lo;
	double w[3] = {0}, length = 0, scale;

	for (int i = 0; i < size; i++)
		length = hypot(length, v[i]);
	if (!(length > 0))
		return;
	for (int i = 0; i < size; i++)
		w[i] = v[i] / length;
	w[0] += w[0] < 0 ? -1 : 1;
	scale = 1 / fabs(w[0]);
	for (int j = from; j <= hi; j++)
		reflect_three(&AT(k, j), n, size, w, scale);
	for (int j = lo; j <= hi && j <= k + 3; j++)
		reflect_three(&AT(j, k), 1, size, w, scale);
}

/*
 * Two shifts at once: @middle ± √@root2. Numbers near a shift are subtracted from it first, so that blocks of equal
 * eigenvalues go on, too.
 */
struct shifts {
	double middle, root2;
};

/* A step of the block lo … hi, of three and more. */
static void step_eigenvalues(double *a, int n, int lo, int hi, struct shifts by)
{
	double first = AT(lo, lo) - by.middle, second = AT(lo + 1, lo + 1) - by.middle;
	double v[3] = {
		(first * first - by.root2) / AT(lo + 1, lo) + AT(lo, lo + 1),
		first + second,
		AT(lo + 2, lo + 1),
	};

	for (int k = lo; k < hi; k++) {
		reflect(a, n, lo, hi, k, v);
		for (int i = 0; i < 3; i++)
			v[i] = k + 1 + i <= hi ? AT(k + 1 + i, k) : 0;
		/* Below the diagonal it is 0 but for rounding. */
		for (int i = k + 1; i <= hi && i <= k + 2 && k > lo; i++)
			AT(i, k - 1) = 0;
	}
}

/*
 * The row where the block that ends in @hi begins. A number below the diagonal counts as 0 if it is small beside
 * that, or @least: that of poses on their way is 0.
 */
static int begin_of(double *a, int n, int hi, double least)
{
	for (int lo = hi; lo > 0; lo--) {
		double size = fabs(AT(lo - 1, lo - 1)) + fabs(AT(lo, lo));

		if (fabs(AT(lo, lo - 1)) <= DBL_EPSILON * fmax(size, least)) {
			AT(lo, lo - 1) = 0;
			return lo;
		}
	}
	return 0;
}

/*
 * Rows and columns of a block of one size: else a block with eigenvalues near 0 under large elements takes no end of
 * steps. After Parlett and Reinsch, Balancing a matrix for calculation of eigenvalues and eigenvectors, 1969.
 */
static void balance(double *a, int n, int lo, int hi)
{
	for (int i = lo; i <= hi; i++) {
		double row = 0, column = 0, part;

		for (int j = lo; j <= hi; j++) {
			row += j == i ? 0 : fabs(AT(i, j));
			column += j == i ? 0 : fabs(AT(j, i));
		}
		if (!(row > 0) || !(column > 0))
			continue;
		part = ldexp(1, (int)lrint(log2(row / column) / 2));
		for (int j = lo; j <= hi; j++) {
			AT(j, i) *= part;
			AT(i, j) /= part;
		}
	}
}

/* The eigenvalues of the last two rows. */
static struct shifts last_two(const double *a, int n, int hi)
{
	double half = (AT(hi - 1, hi - 1) - AT(hi, hi)) / 2;

	return (struct shifts){AT(hi, hi) + half,
			       half * half + AT(hi - 1, hi) * AT(hi, hi - 1)};
}

bool incise_eigenvalues(double *a, int n, double complex eigenvalue[])
{
	double most = 0; /* more of it, for slow blocks */
	int steps = 0;

	for (int i = 0; i < n * n; i++) {
		if (!isfinite(a[i]))
			return false;
		most = fmax(most, fabs(a[i]));
	}
	make_hessenberg(a, n);
	for (int hi = n - 1; hi >= 0;) {
		int lo = begin_of(a, n, hi, ldexp(most, steps / 4));
		struct shifts by;
		double complex root;

		if (lo == hi) {
			eigenvalue[hi--] = AT(lo, lo);
			steps = 0;
			continue;
		}
		by = last_two(a, n, hi);
		root = csqrt(by.root2);
		if (lo == hi - 1) {
			eigenvalue[lo] = by.middle + root;
			eigenvalue[hi] = by.middle - root;
			hi -= 2;
			steps = 0;
			continue;
		}
		if (++steps > STEPS_MOST)
			return false;
		/* If two are real, the nearer one twice, as LAPACK does: both may go round in a circle. */
		if (by.root2 >= 0)
			by = (struct shifts){by.middle + copysign(creal(root),
								  AT(hi, hi) - by.middle),
					     0};
		/* Out of a circle of steps. */
		if (steps % 10 == 0) {
			double off = fabs(AT(hi, hi - 1)) + fabs(AT(hi - 1, hi - 2));

			balance(a, n, lo, hi);
			by = (struct shifts){0.75 * off, -0.4375 * off * off};
		}
		step_eigenvalues(a, n, lo, hi, by);
	}
	return true;
}

/* Solve a x = x, with the largest pivot of each column; a pivot of 0 becomes as small as rounding. */
static void solve_eigenvalues(double *a, int n, double x[])
{
	for (int m = 0; m < n; m++) {
		int pivot = m;

		for (int i = m + 1; i < n; i++)
			if (fabs(AT(i, m)) > fabs(AT(pivot, m)))
				pivot = i;
		for (int j = m; j < n && pivot != m; j++)
			swap(&AT(pivot, j), &AT(m, j));
		if (pivot != m)
			swap(&x[pivot], &x[m]);
		if (fabs(AT(m, m)) < DBL_EPSILON)
			AT(m, m) = DBL_EPSILON;
		for (int i = m + 1; i < n; i++) {
			double part = AT(i, m) / AT(m, m);

			for (int j = m; j < n && part != 0; j++)
				AT(i, j) -= part * AT(m, j);
			x[i] -= part * x[m];
		}
	}
	for (int m = n - 1; m >= 0; m--) {
		for (int j = m + 1; j < n; j++)
			x[m] -= AT(m, j) * x[j];
		x[m] /= AT(m, m);
	}
}

/* (A - λ)(A - λ*) is real, and 0 on the plane of λ. */
void incise_eigenvector(const double *matrix, int n, double complex eigenvalue, double *a,
			double x[])
{
	double sum = 2 * creal(eigenvalue),
	       product = creal(eigenvalue * conj(eigenvalue));

	for (int round = 0; round < 3; round++) {
		double length = 0;

		for (int i = 0; i < n; i++)
			for (int j = 0; j < n; j++) {
				AT(i, j) =
					(i == j ? product : 0) - sum * matrix[i * n + j];
				for (int k = 0; k < n; k++)
					AT(i, j) += matrix[i * n + k] * matrix[k * n + j];
			}
		solve_eigenvalues(a, n, x);
		for (int i = 0; i < n; i++)
			length = hypot(length, x[i]);
		for (int i = 0; i < n; i++)
			x[i] /= length;
	}
}
