/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Jang's hybrid learning, as MATLAB does it: one epoch solves the consequents by least
 * squares and then moves the membership functions down the gradient. The engine behind
 * incise_train() with `classic`.
 */
#ifndef INCISE_ANFIS_H
#define INCISE_ANFIS_H

#include "watch.h"

struct incise_anfis {
	const struct incise_pairs *train;
	const struct incise_pairs *check; /* or NULL: chooses the epoch to keep */
	double ridge;
	double step; /* initial */
	int epochs;
	struct incise_watch *watch; /* or NULL */
	/* Results, of the kept epoch: that of the least check (else training) error. */
	int best_epoch;
	double train_rmse, check_rmse;
};

/* Run the epochs. Returns 0, -EDOM, -ENOMEM, -ECANCELED, -ENOTSUP (not a grid). */
int incise_anfis_run(struct incise_model *model, struct incise_anfis *anfis);

#endif
