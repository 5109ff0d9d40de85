/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Consequents from few cuts: the average of many ridge fits at the same premises, weighted by
 * their errors on held-out groups. A weighted sum of consequents is a model of the same
 * rules, so the average costs nothing when the model runs. Pairs are scaled.
 *
 * A fit penalises the differences between neighbouring rules, along each input with a strength
 * of its own; the plane and the mean of the output are its limits. Every fit comes twice if
 * the groups are cuts: also with a random factor of each cut in the covariance.
 */
#ifndef INCISE_AVERAGE_H
#define INCISE_AVERAGE_H

#include "crossval.h"

struct incise_average;

/*
 * Fit and weigh all settings at fixed premises. error is NULL, or gets the held-out squared
 * error of the average by unit. Returns 0; -E2BIG (too many unknowns for a comparison), -EDOM,
 * -ECANCELED, -ENOMEM.
 */
int incise_average_find(struct incise_average **average, const struct incise_basis *basis,
			const struct incise_folds *folds, double *error);
void incise_average_free(struct incise_average *average);

/* The consequents of all pairs in lsq. Returns 0, -EDOM or -ENOMEM. */
int incise_average_solve(const struct incise_average *average, struct incise_lsq *lsq,
			 double *consequents);

/*
 * The factor of all pairs in lsq at the setting with the largest weight, laid out as by
 * incise_lsq_factor(); to be freed. NULL with errno EDOM or ENOMEM.
 */
double *incise_average_factor(const struct incise_average *average,
			      struct incise_lsq *lsq, int *stride);

/*
 * error/√(1 + leverage) of each of the n_held pairs, for the average of each fold and the
 * factor of its setting with the largest weight. Returns 0, -EDOM, -ENOMEM.
 */
int incise_average_ratios(const struct incise_average *average,
			  const struct incise_basis *basis,
			  const struct incise_folds *folds, double *ratios);

/* Settings with a weight of at least 1 %, and the weights of some. */
struct incise_average_shares {
	int settings;
	double plane, mean, cuts;
};
struct incise_average_shares incise_average_shares(const struct incise_average *average);

#endif
