// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Small symmetric matrices; see dense.h.
 */
#include <math.h>
#include <string.h>
#include "dense.h"

#define EIGEN_MAX 9
#define SWEEPS_MAX 30

bool incise_cholesky(double *a, int n)
{
	for (int i = 0; i < n; i++) {
		double *row = a + (size_t)i * n;

		for (int j = 0; j <= i; j++) {
			const double *other = a + (size_t)j * n;
			double sum = row[j];

			for (int k = 0; k < j; k++)
				sum -= row[k] * other[k];
			if (i == j && !(sum > 0 && isfinite(sum)))
				return false;
			row[j] = i == j ? sqrt(sum) : sum / other[j];
		}
	}
	return true;
}

void incise_cholesky_solve(const double *l, int n, double *x)
{
	for (int i = 0; i < n; i++) {
		for (int k = 0; k < i; k++)
			x[i] -= l[(size_t)i * n + k] * x[k];
		x[i] /= l[(size_t)i * n + i];
	}
	for (int i = n - 1; i >= 0; i--) {
		for (int k = i + 1; k < n; k++)
			x[i] -= l[(size_t)k * n + i] * x[k];
		x[i] /= l[(size_t)i * n + i];
	}
}

/* One rotation in the plane of p and q, which makes a[p][q] zero (Golub and Van Loan, 8.5). */
static void jacobi_rotate(double *a, double *v, int n, int p, int q)
{
	double theta = (a[q * n + q] - a[p * n + p]) / (2 * a[p * n + q]);
	double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
	double c = 1 / sqrt(t * t + 1), s = t * c;

	for (int k = 0; k < n; k++) {
		double x = a[k * n + p], y = a[k * n + q];

		a[k * n + p] = c * x - s * y;
		a[k * n + q] = s * x + c * y;
	}
	for (int k = 0; k < n; k++) {
		double x = a[p * n + k], y = a[q * n + k];

		a[p * n + k] = c * x - s * y;
		a[q * n + k] = s * x + c * y;
	}
	for (int k = 0; k < n; k++) {
		double x = v[k * n + p], y = v[k * n + q];

		v[k * n + p] = c * x - s * y;
		v[k * n + q] = s * x + c * y;
	}
	a[p * n + q] = a[q * n + p] = 0;
}

/* Put the eigenvalues on the diagonal of a, with their vectors in v, in ascending order. */
static void order(const double *a, const double *v, int n, double *to, double *values)
{
	for (int i = 0; i < n; i++) {
		int at = 0;

		for (int k = 0; k < n; k++)
			at += a[k * n + k] < a[i * n + i] ||
			      (k < i && a[k * n + k] == a[i * n + i]);
		values[at] = a[i * n + i];
		for (int k = 0; k < n; k++)
			to[k * n + at] = v[k * n + i];
	}
}

void incise_eigen(double *a, int n, double *values)
{
	double w[EIGEN_MAX * EIGEN_MAX], v[EIGEN_MAX * EIGEN_MAX] = {0};
	bool rotated = true;

	for (int i = 0; i < n; i++) {
		for (int k = 0; k <= i; k++)
			w[i * n + k] = w[k * n + i] = a[i * n + k];
		v[i * n + i] = 1;
	}
	/* it converges quadratically: 5 or 6 sweeps */
	for (int sweep = 0; sweep < SWEEPS_MAX && rotated; sweep++) {
		rotated = false;
		for (int p = 0; p < n; p++)
			for (int q = p + 1; q < n; q++)
				if (fabs(w[p * n + q]) >
				    1e-17 * (fabs(w[p * n + p]) + fabs(w[q * n + q]))) {
					jacobi_rotate(w, v, n, p, q);
					rotated = true;
				}
	}
	order(w, v, n, a, values);
}
