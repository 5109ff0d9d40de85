/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Steps of a training from sources (incise/corpus.h) that are not public by themselves: a search
 * on a sample, whose consequents are fitted to the sums of all pairs, and steps that a caller may
 * end.
 */
#ifndef INCISE_LEARN_TRAIN_H
#define INCISE_LEARN_TRAIN_H

#include <incise/factor.h>
#include "watch.h"

/* The sums of all pairs, of which a training is given a sample. */
struct incise_train_sums {
	/*
	 * Find them at the membership functions of a model: a factor, which stays the caller's.
	 * Called once. 0, or a negative errno, whose error is the caller's own.
	 */
	int (*find)(void *user, const struct incise_model *premises,
		    struct incise_factor **sums);
	void *user;
	/*
	 * They have weights: there are no fits with a random factor of each group, and the model
	 * that find is given has the consequents of the sample.
	 */
	bool weighted;
};

/* As incise_train(); sums NULL: the pairs given are all. */
int incise_train_sample(struct incise_model *model, const struct incise_pairs *train,
			const struct incise_pairs *check,
			const struct incise_train_options *options,
			const struct incise_train_sums *sums,
			struct incise_train_report *report, struct incise_error *err);

/* As incise_factor_solve(). -ECANCELED where the watch ends it. */
struct incise_model *incise_factor_solve_watched(struct incise_factor *factor,
						 const struct incise_factor_ridge *ridge,
						 struct incise_train_report *report,
						 struct incise_uncertainty **uncertainty,
						 struct incise_watch *watch,
						 struct incise_error *err);

/* As incise_baselines(). -ECANCELED where the watch ends it. */
int incise_baselines_watched(const struct incise_pairs *train, const int *groups,
			     const struct incise_pairs *on,
			     struct incise_baselines *result, struct incise_watch *watch,
			     struct incise_error *err);

#endif
