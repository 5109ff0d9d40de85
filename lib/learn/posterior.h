/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The predictive standard deviation of a trained model (incise/uncertainty.h): Bayesian
 * linear consequents, whose prior is the ridge, with the noise of groups left out.
 */
#ifndef INCISE_POSTERIOR_H
#define INCISE_POSTERIOR_H

#include "basis.h"
#include "crossval.h"

/*
 * The noise, in scaled units, with which ±1.96 sd holds 95 % of the held-out pairs, when
 * premises are searched from those in basis for so many epochs. Returns 0, -EDOM, -ENOMEM.
 */
int incise_posterior_noise(const struct incise_basis *basis,
			   const struct incise_folds *folds,
			   const struct incise_ridge *ridge, int epochs, double *noise);

#endif
