/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Learning without the pairs at hand: a factor has the sums that least squares needs of all pairs
 * of a share, at given membership functions (premises). Sums are exact integers, so factors of
 * shares, in any number and order, add up to the factor of all pairs, to the bit: the model of a
 * merge is the file that one computer makes of all pairs. Part of libincise-learn.
 *
 *     pairs of laboratory A ──► factor ──┐
 *     pairs of laboratory B ──► factor ──┴──► merge ──► solve ──► model
 *
 * One thread at a time may use a factor.
 */
#ifndef INCISE_FACTOR_H
#define INCISE_FACTOR_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>
#include <incise/train.h>
#include <incise/uncertainty.h>

INCISE_BEGIN_DECLS

/** Parts of a factor for cross-validation; a group is in one of them, by the hash of its name. */
#define INCISE_FACTOR_FOLDS 5

/** A part of a file has at least this many different pairs, and as many as it has sums. */
#define INCISE_FACTOR_PAIRS_MIN 1000

/** A part of a file has pairs of at least this many groups. */
#define INCISE_FACTOR_GROUPS_MIN 5

/** Length of the text of a source, with its 0. */
#define INCISE_FACTOR_TEXT_MAX 1000

/** A recording or file whose pairs are in a factor. */
struct incise_factor_source {
	char hash[65]; /**< SHA-256 of its bytes, hexadecimal */
	uint64_t rows; /**< pairs */
	char text
		[INCISE_FACTOR_TEXT_MAX]; /**< name, origin, rig and calibration, one line */
};

/** Contents of a factor, without its sums. */
struct incise_factor_info {
	uint64_t rows, groups; /**< pairs; groups, which are counted by source */
	uint64_t different;    /**< pairs, equal ones counted once; 0: not counted */
	int parts; /**< for cross-validation; fewer than INCISE_FACTOR_FOLDS if some are joined */
	int n_inputs, n_rules;
	int n_sources;
	const struct incise_factor_source *sources; /**< by hash */
	/** Smallest and largest value of each input, then of the output; 0 without rows. */
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	const char *premises; /**< SHA-256 of membership functions, ranges and names */
	const char *version;  /**< of the incise that made it */
	const char *options;  /**< one line; "" if none */
};

struct incise_factor;

/** SHA-256 of a file's bytes. @return 0; the negative errno of open(2) or read(2). */
INCISE_API int incise_file_sha256(const char *path, char hex[65],
				  struct incise_error *err);

/**
 * Make a factor without pairs, at the membership functions and ranges of a model.
 *
 * @return factor, to be freed with incise_factor_free(); NULL with errno ENOTSUP (the rules are not
 *         a full grid, or the functions of an input are not all Gaussians or all bells), EINVAL
 *         (an output without a range), ENOMEM.
 */
INCISE_API struct incise_factor *incise_factor_new(const struct incise_model *premises,
						   struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_factor_free(struct incise_factor *factor);

/** Set the options of the training, one line for people; longer text is cut. */
INCISE_API void incise_factor_set_options(struct incise_factor *factor,
					  const char *options);

/**
 * Start a source: further pairs are its own.
 *
 * @return 0, -EEXIST (a source of this hash is there), -ENOMEM.
 */
INCISE_API int incise_factor_start(struct incise_factor *factor, const char *hash,
				   const char *text, struct incise_error *err);

/**
 * Add a pair of the source.
 *
 * @param row   inputs, then output
 * @param group number of its group, the same in all sources; see incise_group_key()
 * @return 0, -ERANGE (a value is a whole range or more outside the model's ranges), -EOVERFLOW
 *         (more than 2^33 pairs).
 */
INCISE_API int incise_factor_add(struct incise_factor *factor, const double *row,
				 uint64_t group, struct incise_error *err);

/**
 * Count the pairs in the part of a group: a factor needs all its groups counted before it is saved.
 *
 * @param group     as in incise_factor_add()
 * @param groups    number of groups
 * @param different pairs of them, equal ones counted once
 */
INCISE_API void incise_factor_count(struct incise_factor *factor, uint64_t group,
				    uint64_t groups, uint64_t different);

/** A group's number, from its name; @source: a source's hash, for a name of its own, or "". */
INCISE_API uint64_t incise_group_key(const char *source, const char *name);

/** Get the contents of a factor; valid until the factor changes. */
INCISE_API void incise_factor_info(const struct incise_factor *factor,
				   struct incise_factor_info *info);

/**
 * Add the pairs of another factor, which remains as it is. On error @factor is unchanged.
 *
 * @param name name of @other for messages
 * @return 0, -EINVAL (other inputs or units, ranges or membership functions), -EEXIST (a source is
 *         in both, by its hash or by the identity of a recording in its text), -EOVERFLOW, -ENOMEM.
 */
INCISE_API int incise_factor_merge(struct incise_factor *factor,
				   struct incise_factor *other, const char *name,
				   struct incise_error *err);

/**
 * Notes for a model of a factor: version, options and sources, one a line; see
 * incise_model_save_notes(). To be freed with free(3); NULL with errno ENOMEM.
 */
INCISE_API char *incise_factor_notes(const struct incise_factor *factor);

/**
 * Write NAME.fac; see incise-fac(5). Parts of fewer than INCISE_FACTOR_PAIRS_MIN different pairs,
 * fewer than sums, or fewer than INCISE_FACTOR_GROUPS_MIN groups are joined with others before, in
 * @factor too.
 *
 * @return 0; -ENODATA (all together are fewer), the negative errno of incise_outfile_open().
 */
INCISE_API int incise_factor_save(struct incise_factor *factor, const char *path,
				  struct incise_error *err);

/**
 * Read NAME.fac. @return factor, to be freed with incise_factor_free(); NULL with errno of
 * incise_infile_open(), EINVAL (no such file, damaged, or a part of it reveals its pairs),
 * ENOTSUP (of another form or version), ENOMEM.
 */
INCISE_API struct incise_factor *incise_factor_load(const char *path,
						    struct incise_error *err);

/**
 * The bytes of such a file with its parts as they are, for processes of one training: they may
 * reveal pairs. To be freed with free(3). NULL with errno ENOMEM.
 */
INCISE_API void *incise_factor_encode(struct incise_factor *factor, size_t *size);

/** A factor of such bytes; @name for messages. NULL with errno as incise_factor_load(). */
INCISE_API struct incise_factor *incise_factor_decode(const void *bytes, size_t size,
						      const char *name,
						      struct incise_error *err);

/** Ridge of a solution; see incise_train_report. */
struct incise_factor_ridge {
	double ridge; /**< NAN: by cross-validation over the parts */
	double mean; /**< its share for the rules' mean, 0 … 1; used unless ridge is NAN */
	double noise; /**< in the unit of the output; NAN: from the held-out errors of the parts */
};

/**
 * Make the model of all pairs. It has the premises' membership functions.
 *
 * @param report      or NULL; without what only a search has, and check without pairs
 * @param uncertainty or NULL: set to the predictive standard deviation, to be freed with
 *                    incise_uncertainty_free()
 * @return model, to be freed with incise_model_free(); NULL with errno ENODATA (fewer pairs than
 *         consequents), EDOM (least squares failed), ENOMEM.
 */
INCISE_API struct incise_model *incise_factor_solve(
	struct incise_factor *factor, const struct incise_factor_ridge *ridge,
	struct incise_train_report *report, struct incise_uncertainty **uncertainty,
	struct incise_error *err);

/**
 * RMSE of a model of these premises on the pairs of a factor.
 *
 * @param r2 1 - (squared error)/(variation about the mean), NaN for a constant output; or NULL
 * @return NaN without pairs
 */
INCISE_API double incise_factor_rmse(struct incise_factor *factor,
				     const struct incise_model *model, double *r2);

INCISE_END_DECLS
#endif
