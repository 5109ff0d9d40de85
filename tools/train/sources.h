/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Recordings and CSV files that pairs come from, for incise train and incise info --dataset. Every
 * failure ends the program unless it says otherwise.
 */
#ifndef TRAIN_SOURCES_H
#define TRAIN_SOURCES_H

#include <stdbool.h>
#include <incise/budget.h>
#include <incise/corpus.h>

/* The rows of recordings. */
struct recording_rows {
	bool uncertainty; /* with columns of parts */
	bool damaged;	  /* also of recordings that failed verification */
	double rate_hz;	  /* 0: every force sample */
	/* A part, as of struct incise_export_options; of that only what is read is checked. */
	double from_s, to_s;
	int cut;
};

/* Make sources of paths, which outlive them, as the rows do; sources_free(). */
struct incise_train_source *sources_new(char **paths, int n,
					const struct recording_rows *rows);
void sources_free(struct incise_train_source *sources, int n);

/* Whether a source can be read once only, and is kept in memory. */
bool source_is_pipe(const struct incise_train_source *source);

/* Print counts, ranges, and the groups that differ from the others, for incise info. */
void dataset_show(struct incise_train_source *sources, int n,
		  struct incise_sources_options *options, bool json);

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
 * Find those of n_inputs inputs and the output that all sources have, n 0 for none. Fails where
 * some sources have others than the rest, or with UNCERTAINTIES_PARTS one has none.
 */
void uncertainties_find(struct uncertainties *found, enum uncertainties_wanted wanted,
			const char *const *columns, int n_inputs, char **paths, int n);

#endif
