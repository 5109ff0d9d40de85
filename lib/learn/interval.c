// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The width of the prediction interval; see interval.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/ascending.h"
#include "interval.h"

double incise_student(int freedom)
{
	static const double few[] = {12.706, 4.303, 3.182, 2.776, 2.571};
	const double z = INCISE_INTERVAL95, n = freedom;

	if (freedom <= 5)
		return few[freedom - 1];
	/* Cornish and Fisher's expansion. */
	return z + (pow(z, 3) + z) / (4 * n) +
	       (5 * pow(z, 5) + 16 * pow(z, 3) + 3 * z) / (96 * n * n);
}

int incise_interval_noise(const struct incise_basis *basis,
			  const struct incise_folds *folds,
			  const struct incise_ridge *ridge, double *noise)
{
	double *ratios = malloc(folds->n_held * sizeof(*ratios));
	int rc = ratios ? incise_crossval_ratios(basis, folds, ridge, ratios) : -ENOMEM;

	if (!rc) {
		/* The quantile that also holds the pair to come: (n+1)·0.95 from below. */
		double rank = ceil(0.95 * (folds->n_held + 1.0));
		size_t at = fmin(rank, folds->n_held) - 1;

		qsort(ratios, folds->n_held, sizeof(*ratios), ascending);
		*noise = ratios[at] / INCISE_INTERVAL95 *
			 incise_student(folds->n_units - 1) / INCISE_INTERVAL95;
	}
	free(ratios);
	return rc;
}
