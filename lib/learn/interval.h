/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The width of the prediction interval of a model, out of the errors on pairs of groups that
 * a fit has not seen. Pairs are scaled.
 */
#ifndef INCISE_INTERVAL_H
#define INCISE_INTERVAL_H

#include "crossval.h"

/*
 * Set *noise so that ±INCISE_INTERVAL95·noise·√(1 + leverage) holds 95 % of the held-out
 * pairs, with Student's t for the number of units. Returns 0, -EDOM, -ECANCELED, -ENOMEM.
 */
int incise_interval_noise(const struct incise_basis *basis,
			  const struct incise_folds *folds,
			  const struct incise_ridge *ridge, double *noise);

/* The 97.5 % quantile of Student's t for 1 … degrees of freedom, to 0.1 %. */
double incise_student(int freedom);

#endif
