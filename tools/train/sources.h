/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Recordings and CSV files that pairs come from, for incise train and incise info --dataset: each
 * by its hash, read as often as asked. Every failure ends the program unless it says otherwise.
 */
#ifndef TRAIN_SOURCES_H
#define TRAIN_SOURCES_H

#include <stdbool.h>
#include <incise/budget.h>
#include <incise/corpus.h>
#include <incise/error.h>
#include <incise/propagation.h>
#include "../cli/file.h"

/* The columns and rows that are read. */
struct source_options {
	const char *const *columns; /* inputs, then output */
	int n_columns;
	bool uncertainty; /* columns of parts are among them */
	/* none, cut, recording, rig, or a column; NULL: cut where all sources have it, else none. */
	const char *group;
	bool all_rows;	/* also where the blade did not advance */
	bool damaged;	/* also recordings that failed verification */
	double rate_hz; /* of a recording's rows; 0: every force sample */
	/* Called after every 65536 rows and the last of a source. */
	void (*progress)(void *user, uint64_t rows);
	void *user;
};

struct source {
	struct incise_corpus_source corpus;
	const struct source_options *options;
	const char *path;
	bool recording;
	char hash[65], text[INCISE_FACTOR_TEXT_MAX];
	char rig[256], calibration[512]; /* the latter: the same where it is the same */
	uint64_t left_out;		 /* rows in the last reading */
	char *state;			 /* before it was first read; NULL: not yet */
	struct memory_file pipe;	 /* of a source that can be read once only */
	incise_row_taker take; /* of the present reading, and the rows it took */
	void *taker;
	uint64_t taken;
};

/* Of @paths, which outlive them: free(3). Decides @options->group. */
struct source *sources_new(char **paths, int n, struct source_options *options);

void sources_free(struct source *sources, int n);

/* For incise info: counts, ranges, and the groups that differ from the others. Fails the program. */
void dataset_show(char **paths, int n, struct source_options *options, bool json);

/*
 * Path, size and time of all files of a source, and the content of the calibrations by which a
 * recording is read, also of its members: free(3).
 */
char *source_state(const struct source *source);

/*
 * Hash a source, and verify it if it is a recording; its provenance is known afterwards. 0, or a
 * negative errno.
 */
int source_open(struct source *source, struct incise_error *err);

/* Columns of uncertainties, behind those of a model. */
struct uncertainties {
	const char *columns[INCISE_BUDGET_PARTS];
	struct incise_propagation_part parts[INCISE_BUDGET_PARTS];
	int n;
};

enum uncertainties_wanted {
	UNCERTAINTIES_FOUND, /* of files that have them */
	UNCERTAINTIES_NONE,
	UNCERTAINTIES_PARTS
};

/*
 * Find those of n_inputs inputs and the output that all sources have, n 0 for none. Fails the
 * program where some sources have others than the rest, or with UNCERTAINTIES_PARTS one has none.
 */
void uncertainties_find(struct uncertainties *found, enum uncertainties_wanted wanted,
			const char *const *columns, int n_inputs, char **paths, int n);

/*
 * Progress of a training, OUTPUT.progress: what an interrupted one has read, for the next of the
 * same sources and options to go on from. It is written after a source, as a whole, so seldom that
 * writing takes a tenth of the time at most; and it is removed when the program ends by itself.
 */
struct progress;

/* Parts of the file, each some bytes or none. */
enum progress_part { PROGRESS_SURVEYS, PROGRESS_SOURCES, PROGRESS_FIT, PROGRESS_CHECK };
#define PROGRESS_PARTS 4

/*
 * For an output and sources; options: all that changes the result. Reads what an interrupted
 * training of the same left. NULL: one source, or one that can be read once only.
 */
struct progress *progress_new(const char *output, const char *options,
			      const struct source *sources, int n);

/* A part that was read; NULL: none. It is valid until it is replaced. */
const void *progress_part(const struct progress *progress, enum progress_part part,
			  size_t *size);

/* Replace a part by bytes of malloc(3), which become its own. */
void progress_set(struct progress *progress, enum progress_part part, void *bytes,
		  size_t size);

/* Whether it is time to write, and writing. A failure is not one of the training. */
bool progress_due(const struct progress *progress);
void progress_write(struct progress *progress);

#endif
