/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the training pairs themselves can say about how to learn from them: the ridge, the
 * premises to start from, how long to search, and how many membership functions there
 * should be. All by cross-validation (crossval.h), so pairs kept back stay unseen.
 */
#ifndef INCISE_TUNE_H
#define INCISE_TUNE_H

#include "basis.h"
#include "crossval.h"

struct incise_tuning {
	double ridge;
	int start;		   /* from 0: the premises given */
	int epochs;		   /* of varpro.h: 1 keeps the premises of the start */
	struct incise_basis basis; /* premises of that start */
	double rmse;		   /* held-out, scaled; NAN where nothing was held out */
};

/* Returns 0, -EDOM, -ENOMEM. */
int incise_tune(const struct incise_basis *basis, const struct incise_folds *folds,
		const struct incise_train_options *options, struct incise_tuning *tuning);

/* Where there is nothing to cross-validate with; good on real tissue data. */
#define TUNE_RIDGE 1.0

/* The ridges tried. */
#define TUNE_N_RIDGES 10
extern const double incise_tune_ridges[TUNE_N_RIDGES];

#endif
