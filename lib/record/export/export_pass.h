/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A pass over the cuts of some recordings, for what is made of them; recordings are
 * streamed.
 *
 *     recordings ──► cuts ──► sample … sample, end_cut ──► sample … ──► rows of a table
 */
#ifndef INCISE_EXPORT_PASS_H
#define INCISE_EXPORT_PASS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/recording.h>
#include "../read/cut.h"
#include "table_writer.h"

/* Force samples of one bin, or of one row of a raw export. Set to {0} before use. */
struct incise_export_bin {
	uint64_t n;
	double t_s, depth_mm, velocity_mm_s, force_N; /* means */
	double m2; /* sum of squared deviations of the force */
	int cuts;  /* that have samples here */
	int last;  /* the cut counted last */
	bool clipped;
};

void incise_export_bin_add(struct incise_export_bin *bin,
			   const struct incise_cut_sample *sample, double t_s, int cut);

struct incise_export_pass {
	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report report;
	struct incise_error *err;

	char *name;		       /* of the recording under way, unique */
	uint64_t samples, samples_all; /* of force, gone through and to go through */
	int cut;		       /* of all recordings, from 1; that under way */
	int number;		       /* of the same cut in its recording */
	double depth_deepest_mm;       /* of any row, for who finds no cut */
	void *made;		       /* by the visitor */
};

/* What is done with samples; each returns 0 or -errno. */
struct incise_export_visitor {
	int (*sample)(struct incise_export_pass *pass,
		      const struct incise_cut_sample *sample, double t_s);
	int (*end_cut)(struct incise_export_pass *pass); /* or NULL */
};

/*
 * Names a recording unlike any before it, so that a/liver.rec and b/liver.rec stay apart;
 * to be freed. NULL: no memory.
 */
char *incise_export_name(struct incise_recording *const *recordings, int at);

/* Number of the present cut's name in the table, or -ENOMEM. */
int incise_export_cut_name(struct incise_export_pass *pass);

/* Where the bins end that are given no end: at the largest that is not clipped. */
void incise_export_extent(struct incise_export_pass *pass,
			  const struct incise_cut_sample *sample);

/* Every sample in a cut, in order. Returns 0 or -errno. */
int incise_export_each(struct incise_export_pass *pass,
		       struct incise_recording *const *recordings, int n,
		       const struct incise_export_visitor *visitor);

#define INCISE_EXPORT_CUT                                                            \
	{                                                                            \
		"cut", "1", "recording and number of the cut", INCISE_COLUMN_NAME, 0 \
	}

/* The two tables of cuts. */
#define INCISE_EXPORT_RAW_COLUMNS 6
#define INCISE_EXPORT_BIN_COLUMNS 7
extern const struct incise_column incise_export_raw_columns[INCISE_EXPORT_RAW_COLUMNS];
extern const struct incise_column incise_export_bin_columns[INCISE_EXPORT_BIN_COLUMNS];

/* Put all rows into the table, but for its end. */
int incise_export_raw(struct incise_export_pass *pass,
		      struct incise_recording *const *recordings, int n);
int incise_export_bins(struct incise_export_pass *pass,
		       struct incise_recording *const *recordings, int n);

#endif
