/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Errors on pairs that a fit has not seen, out of the training pairs alone: five folds
 * that leave whole groups out (cuts), because pairs of one group are not independent.
 * Errors are kept by unit (group, or pair where there are no groups), so that two settings
 * can be compared unit by unit. The ridge is chosen by them. Pairs are scaled.
 */
#ifndef INCISE_CROSSVAL_H
#define INCISE_CROSSVAL_H

#include "basis.h"
#include "watch.h"

#define CROSSVAL_FOLDS 5

/* Pairs that choose settings unless told otherwise. */
#define TUNED_PAIRS 3000

struct incise_folds {
	int n; /* below 2: nothing can be held out */
	int n_units;
	size_t n_held; /* pairs, over all folds */
	struct incise_pairs fit[CROSSVAL_FOLDS], held[CROSSVAL_FOLDS];
	int *unit[CROSSVAL_FOLDS];  /* of each held pair */
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
 * error/√(1 + φᵀ(ΦᵀΦ+λ)⁻¹φ) of each of the n_held pairs: the error in units of the noise.
 * Returns as above.
 */
int incise_crossval_ratios(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridge, double *ratios);

/* The ridges tried for a grid: rules that differ freely, …, a plane, the mean. */
#define CROSSVAL_RIDGES 10
void incise_crossval_settings(const struct incise_basis *basis,
			      struct incise_ridge *ridges);

/*
 * The law a·d + b·d² + c·v + … of the first input and the others, through the raw 0 of all, for
 * incise_ridge.free: as many rows as inputs and one; with its products e·d·v, … twice as many as inputs.
 * offset and scale are those of the inputs and the output. To be freed with free(3); NULL: the grid has none.
 */
double *incise_quadratic(const struct incise_basis *basis, const double *offset,
			 const double *scale);

/* The best of these ridges, with its held-out squared errors by unit, to be freed with free(3). */
struct incise_choice {
	struct incise_ridge ridge;
	double *error, total;
	int n_units;
	double plane, mean, quadratic; /* totals of these; the last may be NAN */
};

/*
 * quadratic is NULL or these rows, which outlive the choice: also ridges towards the law with products are
 * tried, and the law is preferred where it is not worse by more than a standard error. Returns 0, -EDOM,
 * -ECANCELED, -ENOMEM.
 */
int incise_crossval_choose(const struct incise_basis *basis,
			   const struct incise_folds *folds, const double *quadratic,
			   struct incise_choice *choice);

/* Sum over units. */
double incise_crossval_total(const struct incise_folds *folds, const double *error);

/*
 * Standard error of the difference of two totals, from the differences by unit; 0 where
 * there is one unit.
 */
double incise_crossval_spread(int n_units, const double *a, const double *b);

#endif
