/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Least squares in bounded memory: rows are folded into a triangular factor by QR
 * (LAPACK's dgeqrf) block by block; the normal equations are never formed. The factor
 * serves any number of ridge penalties.
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

/* The row filled in since then stands for row·x = target. Returns 0 or -EDOM. */
int incise_lsq_add(struct incise_lsq *lsq, double target);

/* Minimise |A x - t|² + ridge |x|². Returns 0, -EDOM (singular without ridge), -ENOMEM. */
int incise_lsq_solve(struct incise_lsq *lsq, double ridge, double *x);

/* Largest over smallest singular value of A; HUGE_VAL when that is 0. */
int incise_lsq_condition(struct incise_lsq *lsq, double *condition);

#endif
