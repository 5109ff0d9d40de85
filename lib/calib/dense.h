/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Small symmetric matrices, row by row: Cholesky's factor and the eigenvalues. A few hundred
 * operations do not need LAPACK, whose results depend on the BLAS that is installed.
 */
#ifndef INCISE_DENSE_H
#define INCISE_DENSE_H

#include <stdbool.h>

/* L of a = L Lᵀ into the lower triangle, which alone is read. False: not positive definite. */
bool incise_cholesky(double *a, int n);

/* x = (L Lᵀ)⁻¹ x */
void incise_cholesky_solve(const double *l, int n, double *x);

/*
 * Eigenvalues, ascending, of a positive semidefinite matrix; a becomes the eigenvectors, vector k
 * in column k. The errors are some 1e-16 of the largest eigenvalue. n is at most 9.
 */
void incise_eigen(double *a, int n, double *values);

#endif
