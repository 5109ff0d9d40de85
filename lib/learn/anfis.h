/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Jang's hybrid learning: one epoch solves the consequents by least squares and then
 * moves the membership functions down the gradient. The engine behind incise_train().
 */
#ifndef INCISE_ANFIS_H
#define INCISE_ANFIS_H

#include <incise/train.h>

struct incise_lsq;

struct incise_anfis {
	const struct incise_pairs *train;
	const struct incise_pairs *check; /* or NULL: measured, never learnt from */
	double ridge;
	double step; /* initial */
	int epochs;
	/*
	 * Keep each function within half and twice its first width, and centres in order and
	 * at least a quarter of their first distance apart, so that they go on overlapping.
	 */
	bool keep_shape;
	/* Keep the epoch of the least check error (training error without check data)
	 * instead of the last. */
	bool keep_best;
	/* Called with the epoch, from 1, and RMSEs; may be NULL. */
	incise_train_progress progress;
	void *user;
	/* Results */
	int best_epoch;
	double train_rmse, check_rmse;
};

/*
 * Fold all pairs into lsq, as rows of normalised firing strengths times inputs: column
 * r·(n_inputs+1) + i. Returns 0 or -EDOM.
 */
int incise_anfis_fold(const struct incise_model *model, const struct incise_pairs *pairs,
		      struct incise_lsq *lsq);

/* Set all consequents from a solution of that. */
void incise_anfis_set_consequents(struct incise_model *model, const double *x);

/* Run the epochs. Returns 0, -EDOM, -ENOMEM. */
int incise_anfis_run(struct incise_model *model, struct incise_anfis *anfis);

/* Number of premise parameters. */
int incise_anfis_n_premises(const struct incise_model *model);

#endif
