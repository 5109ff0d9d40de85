/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Eigenvalues of a real matrix, and the directions in which it turns, for the checks of loops: LAPACK's dgeev
 * without LAPACK, which the programs of a rig would all have to load for it.
 */
#ifndef INCISE_EIGENVALUES_H
#define INCISE_EIGENVALUES_H

#include <complex.h>
#include <stdbool.h>

/*
 * Of a matrix, row by row, which is lost: by the double shift of Francis on its Hessenberg form (Golub and Van Loan,
 * Matrix Computations, 4th edition, algorithms 7.4.2 and 7.5.1). It is not balanced: rows and columns should be of one size.
 *
 * @return false: an element is not finite, or one of them does not converge.
 */
bool incise_eigenvalues(double *matrix, int n, double complex eigenvalue[]);

/*
 * A vector of the plane in which an eigenvalue turns, by inverse iteration.
 *
 * @param work  n × n, and is lost
 * @param x     in: any vector; out: of length 1
 */
void incise_eigenvector(const double *matrix, int n, double complex eigenvalue,
			double *work, double x[]);

#endif
