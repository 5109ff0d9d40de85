/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Errors on pairs that a fit has not seen, out of the training pairs alone: five folds
 * that leave whole groups out (cuts), because pairs of one group are not independent.
 * Errors are kept by unit (group, or pair where there are no groups), so that two settings
 * can be compared unit by unit. Pairs are scaled.
 */
#ifndef INCISE_CROSSVAL_H
#define INCISE_CROSSVAL_H

#include "basis.h"
#include "watch.h"

#define CROSSVAL_FOLDS 5
#define CROSSVAL_REPEATS 4
#define CROSSVAL_MAX (CROSSVAL_FOLDS * CROSSVAL_REPEATS)

/*
 * Few cuts make one division into folds a game of chance: it is repeated with others
 * where the pairs are few enough, and n counts the folds of all of them.
 */
struct incise_folds {
	int n; /* below 2: nothing can be held out */
	int n_units;
	bool cuts;     /* units are groups, and the pairs are all that they have */
	double zero;   /* raw output 0 in scaled units */
	size_t n_held; /* pairs, over all folds */
	struct incise_pairs fit[CROSSVAL_MAX], held[CROSSVAL_MAX];
	int *unit[CROSSVAL_MAX];    /* of each held pair */
	struct incise_watch *watch; /* or NULL */
};

/* Returns 0 or -ENOMEM; incise_folds_free() in either case. */
int incise_folds_init(struct incise_folds *folds, const struct incise_pairs *pairs,
		      const int *groups, uint64_t seed);
void incise_folds_free(struct incise_folds *folds);

/*
 * Held-out squared errors of n ridges at fixed premises: error[i·n_units + unit] for ridge
 * i. Returns 0, -EDOM, -ECANCELED, -ENOMEM.
 */
int incise_crossval_ridges(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridges, int n, double *error);

/*
 * Held-out squared errors while premises are searched (varpro.h), by epoch:
 * error[e·n_units + unit] for epoch e+1. Where a fold's search ends early its last error
 * stands for the epochs left. Returns as above. ratios is NULL, or gets error/√(1 + φᵀ(ΦᵀΦ+λ)⁻¹φ) of each
 * of the n_held pairs after the last epoch: the error in units of the noise.
 */
int incise_crossval_search(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridge, int epochs, double *error,
			   double *ratios);

/* Sum over units. */
double incise_crossval_total(const struct incise_folds *folds, const double *error);

/*
 * Standard error of the difference of two totals, from the differences by unit; 0 where
 * there is one unit.
 */
double incise_crossval_spread(const struct incise_folds *folds, const double *a,
			      const double *b);

#endif
