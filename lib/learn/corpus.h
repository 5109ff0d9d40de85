/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surveys of all sources, and what is chosen from them: the rows that are held out, and the
 * sample.
 */
#ifndef INCISE_LEARN_CORPUS_H
#define INCISE_LEARN_CORPUS_H

#include <incise/corpus.h>
#include "factor.h"
#include "pairs.h"
#include "propagation.h"

/* A source as it is read. */
struct incise_corpus_source {
	const char *name;  /* for messages */
	const char *hash;  /* SHA-256 of its bytes, hexadecimal */
	const char *text;  /* provenance, one line */
	const char *group; /* of all its rows; "": the text that comes with each row */
	bool own_groups; /* groups of that text are others than those of other sources */
	/* Read all rows, the same at each call: inputs, then output. 0 or a negative errno. */
	int (*read)(void *user, incise_row_taker take, void *taker,
		    struct incise_error *err);
	void *user;
	uint64_t left_out;	 /* set by read: rows that it left out */
	const char *calibration; /* NULL: its own */
};

/*
 * A corpus without sources; NULL with errno ENOMEM.
 *
 *   grouped   hold out whole groups, not rows
 *   seed      of the sample and of the rows or groups held out
 *   sample    rows of the sample at most; SIZE_MAX: all different rows
 */
struct incise_corpus *incise_corpus_new(int n_inputs, bool grouped, uint64_t seed,
					size_t sample);

/* NULL is accepted. */
void incise_corpus_free(struct incise_corpus *corpus);

/*
 * Fold pairs with the weights of their uncertainties: rows of the sources have the columns of a
 * propagation behind the output, and incise_corpus_fold() adds those that are not held out to
 * it. The caller starts and ends its passes. A factor of such pairs cannot be saved or merged.
 */
void incise_corpus_weigh(struct incise_corpus *corpus,
			 struct incise_propagation *propagation);

/* Keep n further columns of the sample, which rows have from number @at. */
void incise_corpus_keep(struct incise_corpus *corpus, int at, int n);

/*
 * The rows of the training's sample with further column i as their last input; free(3). NULL: no memory,
 * or any row of a source, held out or not, is NaN there.
 */
double *incise_corpus_extend(const struct incise_corpus *corpus, int i);

/*
 * Survey a source. 0; -EEXIST (its hash is there already, or a recording that its text names),
 * -ENOMEM, or the negative errno of its read: the corpus is then of no further use.
 */
int incise_corpus_survey(struct incise_corpus *corpus,
			 const struct incise_corpus_source *source,
			 struct incise_error *err);

/* The surveys as bytes, for another process; to be freed with free(3). NULL: ENOMEM. */
void *incise_corpus_encode(struct incise_corpus *corpus, size_t *size);

/*
 * Add the surveys of another process. 0, -EEXIST, -EINVAL (no such bytes), -ENOMEM: the corpus is
 * then of no further use.
 */
int incise_corpus_add(struct incise_corpus *corpus, const void *bytes, size_t size,
		      struct incise_error *err);

/*
 * All sources are surveyed: choose the sample and a share that is held out, 0 ≤ share < 1, as near
 * as groups and equal rows allow. 0; -EINVAL (fewer than two groups or different rows to share),
 * -ENODATA (no rows), -ENOMEM.
 */
int incise_corpus_settle(struct incise_corpus *corpus, double share,
			 struct incise_error *err);

/*
 * Add a source's rows to the factors, but for rows held out that are a whole range or more outside;
 * check is NULL where nothing is held out. 0; -ESTALE (its rows are not those of its survey), the
 * negative errno of incise_factor_add() with the source's name, or of its read.
 */
int incise_corpus_fold(const struct incise_corpus *corpus,
		       const struct incise_corpus_source *source,
		       struct incise_factor *fit, struct incise_factor *check,
		       struct incise_error *err);

#endif
