/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Factors (incise/factor.h): made, added up and solved. Sums are exact integers, so those of
 * shares, in any number and order, add up to the sums of all pairs, to the bit.
 */
#ifndef INCISE_LEARN_FACTOR_H
#define INCISE_LEARN_FACTOR_H

#include <incise/factor.h>
#include <incise/train.h>
#include <incise/uncertainty.h>
#include "watch.h"

struct incise_design;

/* Set the options of the training, one line for people; longer text is cut. */
void incise_factor_set_options(struct incise_factor *factor, const char *options);

/*
 * Start a source: further pairs are its own. 0, -EEXIST (a source of this hash is there), -ENOMEM.
 */
int incise_factor_start(struct incise_factor *factor, const char *hash, const char *text,
			struct incise_error *err);

/*
 * Add a pair of the source: inputs, then output; group: number of its group, the same in all
 * sources; weight: above 0 and at most 1, which is 1 in a factor that is saved or merged. 0, -ERANGE
 * (an output that is a whole range or more outside the model's ranges), -EOVERFLOW (more than 2^33
 * pairs).
 */
int incise_factor_add(struct incise_factor *factor, const double *row, uint64_t group,
		      double weight, struct incise_error *err);

/*
 * Count the groups, and the different pairs of them, that are in the part of a group: a factor that
 * is to be saved has all its groups counted.
 */
void incise_factor_count(struct incise_factor *factor, uint64_t group, uint64_t groups,
			 uint64_t different);

/* A group's number, from its name; source: a source's hash, for a name of its own, or "". */
uint64_t incise_group_key(const char *source, const char *name);

/*
 * Add the pairs of another factor, which remains as it is; name is its own for messages. On error
 * the factor is unchanged. 0, -EINVAL (other inputs or units, ranges or membership functions),
 * -EEXIST (a source is in both, by its hash or by the identity of a recording in its text),
 * -EOVERFLOW, -ENOMEM.
 */
int incise_factor_merge(struct incise_factor *factor, struct incise_factor *other,
			const char *name, struct incise_error *err);

/*
 * Notes for a model of a factor: version, options and sources, one a line. To be freed with
 * free(3); NULL with errno ENOMEM.
 */
char *incise_factor_notes(const struct incise_factor *factor);

/*
 * The bytes of such a file with its parts as they are, for processes of one training: they may
 * reveal pairs. To be freed with free(3). NULL with errno ENOMEM.
 */
void *incise_factor_encode(struct incise_factor *factor, size_t *size);

/* A factor of such bytes; name is for messages. NULL with errno as incise_factor_load(). */
struct incise_factor *incise_factor_decode(const void *bytes, size_t size,
					   const char *name, struct incise_error *err);

/* Ridge of a solution; see incise_train_report. */
struct incise_factor_ridge {
	double ridge; /* NAN: by cross-validation over the parts */
	double noise; /* in the unit of the output; NAN: from the held-out errors of the parts */
};

/*
 * Make the model of all pairs, with the premises' membership functions. The report (or NULL) is
 * without what only a search has, and check without pairs. The standard deviation (or NULL) is to be
 * freed with incise_uncertainty_free(). NULL with errno ENODATA (fewer pairs than consequents), EDOM
 * (least squares failed), ECANCELED (by the watch, or NULL), ENOMEM.
 */
struct incise_model *incise_factor_solve(struct incise_factor *factor,
					 const struct incise_factor_ridge *ridge,
					 struct incise_train_report *report,
					 struct incise_uncertainty **uncertainty,
					 struct incise_watch *watch,
					 struct incise_error *err);

/*
 * RMSE of a model of these premises on the pairs of a factor, NaN without; r2 (or NULL) becomes
 * 1 - (squared error)/(variation about the mean), NaN for a constant output.
 */
double incise_factor_rmse(struct incise_factor *factor, const struct incise_model *model,
			  double *r2);

/* Whether texts of sources name the same recording by its identity, though its bytes may differ. */
bool incise_is_same_recording(const char *a, const char *b);

/* The design of a factor, with the sums of all its pairs; valid until the factor changes. */
struct incise_design *incise_factor_design(struct incise_factor *factor);

#endif
