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

#include <incise/model.h>

struct incise_lsq;
struct incise_watch;

/*
 * The ridge: ridge·|p|² over the first n unknowns. If these are the consequents of rules that
 * count through a grid of n_mfs (the last input fastest), it penalises their differences:
 * ridge·Σ|p_a - p_b|² over neighbours a and b, and mean·|p̄|²·(number of rules). A large one
 * leads to equal consequents, which are a plane, and with a large mean to the mean output.
 */
struct incise_ridge {
	double ridge;
	int n;
	double mean;
	int n_mfs[INCISE_MODEL_INPUTS_MAX]; /* all 0: no grid */
	/*
	 * Or NULL; else a row of n, q, and the penalty is ridge·|p - q|², but for differences along the
	 * n_free orthonormal rows that follow it, which cost nothing.
	 */
	const double *free;
	int n_free;
};

/*
 * For n unknowns. Where the watch (or NULL) ends the training, solutions fail. NULL with errno ENOMEM.
 */
struct incise_lsq *incise_lsq_new(int n, struct incise_watch *watch);
void incise_lsq_free(struct incise_lsq *lsq);

struct incise_watch *incise_lsq_watch(const struct incise_lsq *lsq);

/* Forget all rows. */
void incise_lsq_reset(struct incise_lsq *lsq);

/*
 * Row i of the n+1 of the factor without a ridge, for a factor that was found in another way to
 * be put in: elements i … n of each. Rows that wait are forgotten.
 */
double *incise_lsq_factor_row(struct incise_lsq *lsq, int i);

/* The n coefficients of the next row, to be filled in: they are not zero. */
double *incise_lsq_row(struct incise_lsq *lsq);

/* The row filled in since then stands for row·x = target. */
void incise_lsq_add(struct incise_lsq *lsq, double target);

/* The same, so many times; above 0. */
void incise_lsq_add_weighted(struct incise_lsq *lsq, double target, double weight);

/*
 * The factor [R z; 0 ρ] of all rows and of a ridge (or NULL): row i of its n+1 starts at
 * i·*stride. Only the upper triangle has a meaning. It belongs to the lsq and is good until
 * its next use. NULL with errno EDOM where the rows overflow, or ENOMEM.
 */
const double *incise_lsq_factor(struct incise_lsq *lsq, const struct incise_ridge *ridge,
				int *stride);

/* Minimise |A x - t|² and the ridge, or NULL. Returns 0, -EDOM (singular, overflow) or -ENOMEM. */
int incise_lsq_solve(struct incise_lsq *lsq, const struct incise_ridge *ridge, double *x);

/* Solve R x = z for the first n unknowns of a factor whose column `right` is z. */
int incise_lsq_back(const double *factor, int stride, int n, int right, double *x);

/*
 * |R⁻ᵀ a|² for a of n coefficients, which is overwritten: the variance of a·x that the
 * factor's rows leave, in units of the noise.
 */
double incise_lsq_leverage(const double *factor, int stride, int n, double *a);

/* Largest over smallest singular value of A; HUGE_VAL when that is 0. 0, -EDOM, -ENOMEM. */
int incise_lsq_condition(struct incise_lsq *lsq, double *condition);

#endif
