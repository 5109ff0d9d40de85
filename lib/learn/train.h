/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A search on a sample of the pairs of a training from sources (incise/corpus.h), whose consequents
 * are fitted to the sums of all pairs.
 */
#ifndef INCISE_LEARN_TRAIN_H
#define INCISE_LEARN_TRAIN_H

#include "crossval.h"
#include "factor.h"

/* The sums of all pairs, of which a training is given a sample. */
struct incise_train_sums {
	/*
	 * Find them at the membership functions of a model: a factor, which stays the caller's.
	 * Called once. 0, or a negative errno, whose error is the caller's own. NULL: the training ends
	 * with the choice, -EALREADY.
	 */
	int (*find)(void *user, const struct incise_model *premises,
		    struct incise_factor **sums);
	void *user;
	struct incise_choice *choice; /* NULL, or filled; error is to be freed */
	/* They have weights: the model that find is given has the consequents of the sample. */
	bool weighted;
};

/* As incise_train(); sums NULL: the pairs given are all. */
int incise_train_sample(struct incise_model *model, const struct incise_pairs *train,
			const struct incise_pairs *check,
			const struct incise_train_options *options,
			const struct incise_train_sums *sums,
			struct incise_train_report *report, struct incise_error *err);

#endif
