/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training pairs: whether they can be learnt from, a part of them in scaled units, and
 * how much of their spread a model explains.
 */
#ifndef INCISE_PAIRS_H
#define INCISE_PAIRS_H

#include <incise/train.h>
#include "scaling.h"

/* There are pairs and all are finite; `what` names them. 0 or -EINVAL. */
int incise_pairs_check(const struct incise_pairs *pairs, const char *what,
		       struct incise_error *err);

/*
 * They can be trained on: enough for cross-validation's folds (-ENODATA), and no input is
 * constant (-EINVAL).
 */
int incise_pairs_check_inputs(const struct incise_pairs *pairs,
			      const struct incise_variable *inputs,
			      struct incise_error *err);

/* Scaled pairs with their groups, owned. */
struct incise_sample {
	struct incise_pairs pairs;
	double *rows;
	int *groups; /* NULL without */
};

/* At most so many of the pairs, by chance, in their order. Returns 0 or -ENOMEM. */
int incise_sample_take(struct incise_sample *sample, const struct incise_scaling *scaling,
		       const struct incise_pairs *pairs, const int *groups, size_t most,
		       uint64_t seed);
void incise_sample_free(struct incise_sample *sample);

/* 1 - rmse²/variance of the output; NaN where that is constant. */
double incise_pairs_r2(const struct incise_pairs *pairs, double rmse);

#endif
