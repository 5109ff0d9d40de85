/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The width of the prediction interval of a model, out of the errors on pairs of groups that
 * a fit has not seen. Pairs are scaled.
 */
#ifndef INCISE_INTERVAL_H
#define INCISE_INTERVAL_H

#include <incise/uncertainty.h>
#include "crossval.h"

/* The noise of new pairs, and how it depends on the inputs. */
struct incise_interval {
	double noise;
	struct incise_uncertainty_shape shape;
};

/*
 * Set *interval so that ±INCISE_INTERVAL95·noise(x)·√(1 + leverage) holds 95 % of the pairs of a
 * new unit, out of the held-out pairs. Returns 0, -EDOM, -ECANCELED, -ENOMEM.
 */
int incise_interval_noise(const struct incise_basis *basis,
			  const struct incise_folds *folds,
			  const struct incise_ridge *ridge,
			  struct incise_interval *interval);

/* The same out of error/√(1 + leverage) of each held-out pair. */
int incise_interval_fit(const struct incise_folds *folds, const double *ratios,
			struct incise_interval *interval);

/* Values of a unit. */
struct incise_unit {
	double n, sum;
};

/*
 * The variance that the values of a unit have in common, by analysis of variance, and that within units;
 * @square: the sum of the squares of all. 0 where each unit is one value.
 */
double incise_common_variance(const struct incise_unit *unit, int n_units, double square,
			      double *within);

/* Student's t widens the noise by this factor where units are few; 0: their number is not known. */
double incise_interval_widening(uint64_t units);

#endif
