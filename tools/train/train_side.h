/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The pairs on one side of the split, to train from or to check with, and the model that
 * training begins with.
 */
#ifndef INCISE_TRAIN_SIDE_H
#define INCISE_TRAIN_SIDE_H

#include <incise/dataset.h>
#include "train_wish.h"

struct train_side {
	struct incise_pairs pairs;
	double *rows;
	int *groups;
	int n_groups; /* distinct */
};

/* All pairs, or both sides of the split that is wished for. Fails the program. */
void train_sides_take(struct train_side *fit, struct train_side *check,
		      const struct incise_dataset *data, const struct train_wish *wish);
void train_side_free(struct train_side *side);

/* The model as it is before training; with --mf auto its shape is learnt from `fit`. */
struct incise_model *train_first_model(struct train_wish *wish,
				       const struct train_side *fit);

#endif
