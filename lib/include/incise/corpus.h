/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training from many recordings and files, each read twice and never held in memory: a survey
 * (rows, ranges, groups, a random sample), then the sums of a factor (incise/factor.h). Nothing
 * depends on the order of the sources, or on which process surveys which. Part of
 * libincise-learn.
 *
 *     source ──► survey ──┐                              ┌── sources ──► fold ──► factors ─► model
 *     source ──► survey ──┴► settle ──► sample ──► search of premises
 */
#ifndef INCISE_CORPUS_H
#define INCISE_CORPUS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/dataset.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/factor.h>
#include <incise/propagation.h>
#include <incise/train.h>

INCISE_BEGIN_DECLS

/** Rows of a sample that settles premises and ridge. */
#define INCISE_CORPUS_SAMPLE 20000

/** A recording or file. */
struct incise_corpus_source {
	const char *name; /**< for messages */
	const char *hash; /**< SHA-256 of its bytes, hexadecimal */
	const char *text; /**< name, rig, calibration: provenance, one line */
	/** Group of all its rows; NULL: the text that comes with each row. */
	const char *group;
	bool own_groups; /**< groups of that text are others than those of other sources */
	/** Read all rows, the same at each call: inputs, then output. 0 or a negative errno. */
	int (*read)(void *user, incise_row_taker take, void *taker,
		    struct incise_error *err);
	void *user;
	/** Calibration of its rig, any text that is the same for the same one; NULL: its own. */
	const char *calibration;
};

struct incise_corpus;

/** A group of rows, for example a cut. */
struct incise_corpus_group {
	uint64_t key;  /**< as of incise_group_key() */
	char name[64]; /**< cut to this length */
	uint64_t rows;
	/** Sum, smallest and largest value of each column. */
	double sum[INCISE_MODEL_INPUTS_MAX + 1], min[INCISE_MODEL_INPUTS_MAX + 1],
		max[INCISE_MODEL_INPUTS_MAX + 1];
	bool check; /**< held out */
};

/** The survey of a source. */
struct incise_corpus_survey {
	char hash[65], text[INCISE_FACTOR_TEXT_MAX];
	uint64_t rows;
	uint64_t digest; /**< of its rows and their groups in their order */
	int n_groups;
	struct incise_corpus_group *groups; /**< in order of appearance */
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	char name[200]; /**< for messages; cut to this length */
};

/**
 * Make a corpus without sources.
 *
 * @param n_inputs columns of a row are those and the output
 * @param grouped  hold out whole groups, not rows
 * @param seed     of the sample and of the rows or groups held out
 * @param sample   rows of the sample at most; SIZE_MAX: all different rows
 * @return corpus, to be freed with incise_corpus_free(); NULL with errno ENOMEM
 */
INCISE_API struct incise_corpus *incise_corpus_new(int n_inputs, bool grouped,
						   uint64_t seed, size_t sample);

/** NULL is accepted. */
INCISE_API void incise_corpus_free(struct incise_corpus *corpus);

/**
 * Let another thread or a signal handler end the reading of a source: survey and fold return
 * -ECANCELED at the next row once @stop is not 0.
 *
 * @param stop outlives the corpus; NULL (default): none
 */
INCISE_API void incise_corpus_set_stop(struct incise_corpus *corpus,
				       const volatile int *stop);

/**
 * Fold pairs with the weights of their uncertainties: rows of the sources have the columns of a
 * propagation behind the output, and incise_corpus_fold() adds those that are not held out to
 * it. The caller starts and ends its passes. A factor of such pairs cannot be saved or merged.
 *
 * @param propagation outlives the corpus; NULL (default): all weigh the same
 */
INCISE_API void incise_corpus_weigh(struct incise_corpus *corpus,
				    struct incise_propagation *propagation);

/**
 * Survey a source.
 *
 * @return 0; -EEXIST (its hash is there already, or a recording that its text names), -ENOMEM, or the negative errno of its read: the
 *         corpus is then of no further use
 */
INCISE_API int incise_corpus_survey(struct incise_corpus *corpus,
				    const struct incise_corpus_source *source,
				    struct incise_error *err);

/** The surveys as bytes, for another process; to be freed with free(3). NULL: ENOMEM. */
INCISE_API void *incise_corpus_encode(struct incise_corpus *corpus, size_t *size);

/**
 * Add the surveys of another process. @return 0, -EEXIST, -EINVAL (no such bytes), -ENOMEM: the
 * corpus is then of no further use.
 */
INCISE_API int incise_corpus_add(struct incise_corpus *corpus, const void *bytes,
				 size_t size, struct incise_error *err);

/**
 * All sources are surveyed: choose what is held out, and the sample.
 *
 * @param share held out, 0 ≤ share < 1, as near as groups and equal rows allow
 * @return 0; -EINVAL (fewer than two groups or different rows to share), -ENODATA (no rows), -ENOMEM
 */
INCISE_API int incise_corpus_settle(struct incise_corpus *corpus, double share,
				    struct incise_error *err);

/** Number of sources. */
INCISE_API int incise_corpus_sources(const struct incise_corpus *corpus);

/** Survey of a source, in order of their hashes after settling; owned by the corpus. */
INCISE_API const struct incise_corpus_survey *incise_corpus_source(
	const struct incise_corpus *corpus, int i);

/** Rows, groups and ranges of a side. */
struct incise_corpus_side {
	/** A sample of its rows, equal rows of a group once; owned by the corpus. */
	struct incise_train_side sample;
	uint64_t rows;
	/** Rows, equal ones of a group counted once; an estimate beyond the size of the sample. */
	uint64_t different;
	int n_groups;
};

/** A side of the corpus, after settling; owned by the corpus. */
INCISE_API const struct incise_corpus_side *incise_corpus_side(
	const struct incise_corpus *corpus, bool check);

/** Ranges of all rows that are not held out by group: inputs, then output. */
INCISE_API void incise_corpus_ranges(const struct incise_corpus *corpus, double *min,
				     double *max);

/**
 * Add a source's rows to the factors.
 *
 * @param check    factor of the rows held out, or NULL where there are none
 * @param left_out rows held out that are a whole range or more outside; or NULL
 * @return 0; -ESTALE (its rows are not those of its survey), the negative errno of
 *         incise_factor_add() with the source's name, or of its read
 */
INCISE_API int incise_corpus_fold(const struct incise_corpus *corpus,
				  const struct incise_corpus_source *source,
				  struct incise_factor *fit, struct incise_factor *check,
				  uint64_t *left_out, struct incise_error *err);

INCISE_END_DECLS
#endif
