/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Least squares in bounded memory: rows are folded into a triangular factor by
 * Householder reflections, block by block; the normal equations are never formed. The
 * factor serves any number of ridge penalties.
 *
 * The result does not depend on the machine: vector units of any width do the same
 * operations in the same order.
 */
#ifndef INCISE_LSQ_H
#define INCISE_LSQ_H

#include <stddef.h>

struct incise_lsq;

/* For n unknowns; NULL with errno ENOMEM. */
struct incise_lsq *incise_lsq_new(int n);
void incise_lsq_free(struct incise_lsq *lsq);

/* Forget all rows. */
void incise_lsq_reset(struct incise_lsq *lsq);

/* Room for the n coefficients of the next row; zero it is not. */
double *incise_lsq_row(struct incise_lsq *lsq);

/* The row filled in since then stands for row·x = target. */
void incise_lsq_add(struct incise_lsq *lsq, double target);

/*
 * The factor [R z; 0 ρ] of all rows and of ridge on the first n_ridged unknowns: row i of
 * its n+1 begins at i·*stride. Only the upper triangle means something. It belongs to the
 * lsq and is good until its next use. NULL where the rows overflow.
 */
const double *incise_lsq_factor(struct incise_lsq *lsq, double ridge, int n_ridged,
				int *stride);

/* Minimise |A x - t|² + ridge |x|². Returns 0 or -EDOM (singular, or overflow). */
int incise_lsq_solve(struct incise_lsq *lsq, double ridge, double *x);

/* Solve R x = z for the first n unknowns of a factor whose column `right` is z. */
int incise_lsq_back(const double *factor, int stride, int n, int right, double *x);

/*
 * |R⁻ᵀ a|² for a of n coefficients, which is spoilt: what the factor's rows leave unknown
 * of a·x.
 */
double incise_lsq_leverage(const double *factor, int stride, int n, double *a);

/* Largest over smallest singular value of A; HUGE_VAL when that is 0. 0, -EDOM, -ENOMEM. */
int incise_lsq_condition(struct incise_lsq *lsq, double *condition);

#endif
