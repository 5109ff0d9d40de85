/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The nonlinear half of a grid model, laid out for learning: its membership functions as
 * one vector of premises, and their normalised firing strengths, which separate over the
 * inputs. A model is 30 KB; this is the part that changes.
 */
#ifndef INCISE_BASIS_H
#define INCISE_BASIS_H

#include <stdint.h>
#include <incise/train.h>
#include "lsq.h"

#define BASIS_PARAMS_MAX 3 /* of one membership function */

struct incise_basis {
	int n_inputs, n_rules, n_premises;
	int n_mfs[INCISE_MODEL_INPUTS_MAX];
	enum incise_mf_type type[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	/* Index in p of each function's parameters, in the order of incise_mf.p */
	int at[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	double p[INCISE_MODEL_INPUTS_MAX * INCISE_MODEL_MFS_MAX * BASIS_PARAMS_MAX];
};

/*
 * Take the membership functions of a model. Returns 0, or -ENOTSUP when they are neither
 * Gaussians nor bells, or the rules are not the plain grid of them.
 */
int incise_basis_init(struct incise_basis *basis, const struct incise_model *model);

/* Put them into a model; one that is none (a width below 0) stays as it is there. */
void incise_basis_store(const struct incise_basis *basis, struct incise_model *model);

/* Index in incise_basis.p of the centre of a function. */
int incise_basis_centre(const struct incise_basis *basis, int input, int mf);

/* Normalised firing strengths of all rules, as incise_model_firing() has them. */
void incise_basis_firing(const struct incise_basis *basis, const double *x, double *w);

/* ∂log A/∂p of each premise, A the function it belongs to. */
void incise_basis_slopes(const struct incise_basis *basis, const double *x,
			 double *slopes);

/*
 * Σ w(r) (f(r) - y) over the rules of each function: with the slopes, ∂y/∂p. Results in
 * the order of the functions, inputs first to last.
 */
void incise_basis_shares(const struct incise_basis *basis, const double *w,
			 const double *f, double y, double *shares);

/* A row of the consequents' least squares: w(r)·(1, x), rule by rule. */
void incise_basis_row(const struct incise_basis *basis, const double *w, const double *x,
		      double *row);

/* Output for consequents; leaves that of each rule in f. */
double incise_basis_output(const struct incise_basis *basis, const double *w,
			   const double *x, const double *consequents, double *f);

/* Output less the one of a pair: x is its row, inputs and output. */
double incise_basis_error(const struct incise_basis *basis, const double *x,
			  const double *consequents);

/* Fold the rows of all pairs; strengths of the first n_kept pairs are left in kept. */
void incise_basis_fold(const struct incise_basis *basis, const struct incise_pairs *pairs,
		       struct incise_lsq *lsq, double *kept, size_t n_kept);

/* Set all consequents of a model; -EDOM when one is not finite. */
int incise_basis_set_consequents(struct incise_model *model, const double *consequents);

/*
 * Moves of the premises while they learn, on inputs scaled to [0, 1]. A step is in
 * coordinates where all premises are alike: widths and slopes by their logarithm, so that they
 * stay positive, and centres in units of the even spacing.
 */

/* ∂p/∂step of each premise. */
void incise_premises_scale(const struct incise_basis *basis, double *scale);

/* Take a step and bring the functions back into their bounds. */
void incise_premises_step(struct incise_basis *basis, const double *step);

/*
 * The bounds: centres in order within the range, a quarter of the even spacing apart at
 * least; a function still 0.1 half-way to its neighbours and at the end of the range next
 * to it; no wider than four times the even grid's; slopes of bells from 1 to 8.
 */
void incise_premises_project(struct incise_basis *basis);

/* Another start, by seed: centres by up to 0.3 spacings, widths by up to a third. */
void incise_premises_jitter(struct incise_basis *basis, uint64_t seed);

/* The weight of a pair. */
static inline double incise_pairs_weight(const struct incise_pairs *pairs, size_t i)
{
	return pairs->weights ? pairs->weights[i] : 1;
}

#endif
