/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Learning without the pairs at hand: a factor has the sums that least squares needs of all pairs
 * of a share, at given membership functions (premises). Sums are exact integers, so factors of
 * shares, in any number and order, add up to the factor of all pairs, to the bit: the model of a
 * merge is the file that one computer makes of all pairs. Part of libincise-learn.
 *
 *     pairs of laboratory A ──► factor ──┐
 *     pairs of laboratory B ──► factor ──┴──► model
 *
 * incise_train_sources() makes them, and incise_train_factors() a model of them. One thread at a time may use a factor.
 */
#ifndef INCISE_FACTOR_H
#define INCISE_FACTOR_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>

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

/** Get the contents of a factor; valid until the factor changes. */
INCISE_API void incise_factor_info(const struct incise_factor *factor,
				   struct incise_factor_info *info);

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

INCISE_END_DECLS
#endif
