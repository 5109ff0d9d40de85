/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training pairs: their checks, the units for learning, a sample of them, both sides of a split,
 * and a model's error on them.
 *
 * Units for learning: inputs from 0 to 1 over the model's ranges, the output about its mean in
 * standard deviations. So a ridge and a step mean the same for every dataset, and squares of
 * 1e-9 N or 1e9 N neither vanish nor overflow.
 */
#ifndef INCISE_PAIRS_H
#define INCISE_PAIRS_H

#include <incise/dataset.h>
#include <incise/train.h>
#include "basis.h"

struct ArrowArrayStream;

/*
 * Take a row of numbers, in the order of the columns, with the text of its group (NULL without);
 * both are valid during the call. Not 0: no further row is read, and that is returned.
 */
typedef int (*incise_row_taker)(void *user, const double *row, const char *group,
				struct incise_error *err);

/*
 * Read rows one by one, in memory of one row, as incise_dataset_read_where() and
 * incise_dataset_from_arrow() do; columns behind the first n_required are NaN where they have no finite
 * number. 0, their negative errno, or what the taker returned; left_out (or NULL) is set to the number
 * of omitted rows.
 */
int incise_dataset_each(const char *path, const char *const *columns, int n,
			int n_required, const char *group, const char *where,
			incise_row_taker take, void *user, uint64_t *left_out,
			struct incise_error *err);
int incise_dataset_each_arrow(struct ArrowArrayStream *stream, const char *const *columns,
			      int n, int n_required, const char *group, const char *where,
			      incise_row_taker take, void *user, uint64_t *left_out,
			      struct incise_error *err);

/* Scaled = (raw - offset) / scale, per column; the output is the last. */
struct incise_scaling {
	int n_inputs;
	double offset[INCISE_MODEL_INPUTS_MAX + 1];
	double scale[INCISE_MODEL_INPUTS_MAX + 1];
};

void incise_scaling_find(struct incise_scaling *scaling,
			 const struct incise_variable *inputs,
			 const struct incise_pairs *pairs);

/* One row, output included; inputs outside the ranges become their nearest end. */
void incise_scaling_row(const struct incise_scaling *scaling, const double *raw,
			double *scaled);

/* Premises into scaled units, or back. */
void incise_scaling_premises(const struct incise_scaling *scaling,
			     struct incise_basis *basis, bool to_raw);

/* Consequents into raw units; -EDOM when one overflows. */
int incise_scaling_consequents(const struct incise_scaling *scaling, int n_rules,
			       double *consequents);

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

/* RMSE of a model; inputs outside its ranges are clamped to them, or extrapolated. */
double incise_pairs_rmse(const struct incise_model *model,
			 const struct incise_pairs *pairs, bool clamped);

/*
 * Choose which of n rows are kept back for checking, by whole groups (or NULL) and as near to
 * the share as groups allow; both sides keep at least one group. The same seed gives the same
 * split. 0, -EINVAL (share, or fewer than two groups or rows), -ENOMEM.
 */
int incise_split(size_t n, const int *groups, double share, uint64_t seed, bool *check,
		 struct incise_error *err);

/*
 * The same over units with numbers of rows, "groups" or "rows" in messages: the number of a unit
 * that is kept back for checking becomes 0.
 */
int incise_split_units(uint64_t *count, size_t n_units, double share, uint64_t seed,
		       const char *what, struct incise_error *err);

#endif
