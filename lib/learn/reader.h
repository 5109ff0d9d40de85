/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The sources of a training while it runs: each by its hash, read as often as asked. */
#ifndef INCISE_LEARN_READER_H
#define INCISE_LEARN_READER_H

#include "corpus.h"
#include "watch.h"

/* The columns and rows that are read. */
struct incise_reading {
	const char *const *columns; /* inputs, output, uncertainties, further inputs */
	int n_columns, n_required;  /* further inputs are NaN where there are none */
	const char *group;	    /* recording, rig, or a column; NULL: none */
	const char *where; /* column that is 0 in rows to leave out; NULL: none */
	double cost;	   /* operations for a row */
	struct incise_watch *watch;
};

struct incise_reader {
	struct incise_corpus_source corpus;
	struct incise_train_source *given;
	const struct incise_reading *reading;
	char hash[65], text[INCISE_FACTOR_TEXT_MAX], group[256];
	char *state; /* before it was first read; NULL: not yet, or none */
	incise_row_taker take;
	void *taker;
};

/*
 * Sources of @given, to be freed with incise_readers_free(), NULL: no memory. Decides the group of the
 * reading from the one that is wanted.
 */
struct incise_reader *incise_readers_new(struct incise_train_source *given, int n,
					 const char *group,
					 struct incise_reading *reading);
void incise_readers_free(struct incise_reader *sources, int n);

/* Check a source before it is read, and find its hash and texts. 0 or a negative errno. */
int incise_reader_open(struct incise_reader *source, struct incise_error *err);

/* The same from its survey by a training before. */
void incise_reader_resume(struct incise_reader *source,
			  const struct incise_corpus_survey *survey);

/* The text of incise_train_source.state, or NULL; free(3). */
char *incise_reader_state(const struct incise_reader *source);

/*
 * The progress of a training in a file, for the next training of the same sources and options to
 * go on from. It is written after a source, as a whole, so seldom that writing takes a tenth of
 * the time at most. A failure to write it is not one of the training.
 */
struct incise_progress;

/* Parts of the file, each some bytes or none. */
enum incise_progress_part {
	PROGRESS_SURVEYS,
	PROGRESS_FIT,
	PROGRESS_CHECK,
	PROGRESS_PARTS
};

/*
 * Read what an interrupted training left at a path; options: all that changes the result. NULL: no
 * progress is kept of one source or of one whose state is not known, nor where another file is.
 */
struct incise_progress *incise_progress_open(const char *path, const char *options,
					     const struct incise_reader *sources, int n);

/* A part that was read; NULL: none. It is valid until it is replaced. */
const void *incise_progress_part(const struct incise_progress *progress,
				 enum incise_progress_part part, size_t *size);

/* Replace a part by bytes of malloc(3), which become its own; NULL: none. */
void incise_progress_set(struct incise_progress *progress, enum incise_progress_part part,
			 void *bytes, size_t size);

/* Whether it is time to write. */
bool incise_progress_due(const struct incise_progress *progress);
void incise_progress_write(struct incise_progress *progress);

/* The end: remove the file, or leave it for the next training. NULL is accepted. */
void incise_progress_close(struct incise_progress *progress, bool leave);

#endif
