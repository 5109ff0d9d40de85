/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Settings of learning, chosen from the training pairs: the ridge, the premises to start
 * from, the epochs of the search, and the numbers of membership functions. All by
 * cross-validation (crossval.h), so pairs kept back stay unseen.
 */
#ifndef INCISE_TUNE_H
#define INCISE_TUNE_H

#include "average.h"
#include "basis.h"
#include "crossval.h"

struct incise_tuning {
	struct incise_ridge ridge;
	int start;		   /* from 0: the premises given */
	int epochs;		   /* of varpro.h: 1 keeps the premises of the start */
	struct incise_basis basis; /* premises of that start */
	double rmse;		   /* held-out, scaled; NAN where nothing was held out */
	/*
	 * The consequents at the premises given, if they are as good as any other choice: to
	 * be freed with incise_average_free(). NULL: those of the ridge.
	 */
	struct incise_average *average;
};

/* Pairs that a search uses unless told otherwise. */
#define TUNED_PAIRS 3000

/* Returns 0, -EDOM, -ENOMEM. */
int incise_tune(const struct incise_basis *basis, const struct incise_folds *folds,
		const struct incise_train_options *options, struct incise_tuning *tuning);

/* The ridges tried for a grid: of every size, with a mean held down fully or hardly. */
#define TUNE_SIZES 10
#define TUNE_MEANS 2
#define TUNE_RIDGES (TUNE_SIZES * TUNE_MEANS)
void incise_tune_ridges(const struct incise_basis *basis, struct incise_ridge *ridges);

/*
 * Choose the number of membership functions of each input, as incise_train_start() says. 0;
 * -EINVAL, -ENODATA (too few pairs to compare anything), -EDOM, -ENOMEM.
 */
int incise_choose_grid(const struct incise_pairs *pairs,
		       const struct incise_variable *inputs, enum incise_mf_type type,
		       const struct incise_train_options *options, int *n_mfs,
		       struct incise_error *err);

#endif
