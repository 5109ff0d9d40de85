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

/* Fold the rows of all pairs. */
void incise_basis_fold(const struct incise_basis *basis, const struct incise_pairs *pairs,
		       struct incise_lsq *lsq);

/* Set all consequents of a model; -EDOM when one is not finite. */
int incise_basis_set_consequents(struct incise_model *model, const double *consequents);

/*
 * Move the functions of a grid to where the pairs are, on inputs from 0 to 1: centres at even
 * quantiles, with a tenth of the even spacing so that none coincide, and widths that
 * cross at a half with the nearer neighbour. 0 or -ENOMEM.
 */
int incise_basis_place(struct incise_basis *basis, const struct incise_pairs *pairs);

/* The weight of a pair. */
static inline double incise_pairs_weight(const struct incise_pairs *pairs, size_t i)
{
	return pairs->weights ? pairs->weights[i] : 1;
}

#endif
