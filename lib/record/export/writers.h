/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside an export; for lib/record/export/ only.
 */
#ifndef INCISE_EXPORT_PRIVATE_H
#define INCISE_EXPORT_PRIVATE_H

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <incise/budget.h>
#include <incise/recording.h>
#include <incise/wall.h>
#include "provenance.h"
#include "table_writer.h"

/* Report progress, @done of @all. 0, or -EINTR if the callback stops the export. */
static inline int incise_export_progress(const struct incise_export_options *options,
					 double done, double all,
					 struct incise_error *err)
{
	if (options->progress &&
	    options->progress(options->context, fmin(1, done / fmax(1, all))))
		return incise_error_set(err, EINTR, "interrupted");
	return 0;
}

/* The column by which incise train takes the part of a cut that a model describes. */
#define INCISE_ADVANCING_COLUMN                                        \
	{                                                              \
		"advancing", "1", "1: the blade went into new tissue", \
			INCISE_COLUMN_FLAG, 0, NULL, NULL              \
	}

/* --- columns_tai.c ------------------------------------------------------------------ */

#define INCISE_TAI_COLUMNS 2

/* A copy of columns, to be freed, with those of TAI behind them. NULL: no memory. */
struct incise_table_column *incise_tai_columns(const struct incise_table_column *columns,
					       int n);

/* Their cells at a time of CLOCK_MONOTONIC; the mapping must reach to it. Returns 0 or -ENODATA. */
int incise_tai_cells(const struct incise_wall *wall, int64_t t_ns,
		     union incise_cell cells[INCISE_TAI_COLUMNS],
		     struct incise_error *err);

/* --- budget.c ---------------------------------------------------------------------- */

/* As incise_budget_new(), or without reading rows: then only what calibrations state is known. */
struct incise_budget *incise_budget_open(struct incise_recording *recording,
					 const struct incise_export_options *options,
					 bool rows, struct incise_error *err);

/*
 * The parts of a mean over rows, in order of time; starts with {0}. Common parts and smoothing
 * are means, with their signs; own ones get smaller:
 *
 *     force     samples that are independent of each other
 *     depth     each record of the tracker by the weight that it has in the mean
 *     velocity  the same, of the records of its filter: as one
 */
struct incise_budget_mean {
	uint64_t n;
	int recording;		 /* of the present rows */
	int64_t record_ns[2];	 /* of the tracker, around the present row … */
	double depth[2], depth2; /* … their weights, and squares of those before */
	int64_t window;		 /* of the velocity's filter */
	double force2;		 /* squares of the noise of the force */
	double velocity, velocity2;
	double sum[INCISE_BUDGET_PARTS];   /* of own parts squares */
	double past2[INCISE_BUDGET_PARTS]; /* of recordings before */
};

/* Add a row of a recording, between the records of the tracker at these times. */
void incise_budget_mean_add(struct incise_budget_mean *mean,
			    const struct incise_budget *budget, int recording,
			    const int64_t record_ns[2],
			    const struct incise_budget_row *row);
void incise_budget_mean_parts(const struct incise_budget_mean *mean,
			      double part[INCISE_BUDGET_PARTS]);

/* --- columns_budget.c ---------------------------------------------------------------- */

#define INCISE_BUDGET_COLUMNS (INCISE_BUDGET_QUANTITIES + INCISE_BUDGET_PARTS)

/* Columns of a table with those of uncertainties, which replace columns of their names. */
struct incise_budget_columns {
	struct incise_table_column *columns; /* to be freed */
	int n;
	int at[INCISE_BUDGET_COLUMNS]; /* totals, then parts; -1: not there */
};

/* Of quantities that have a column. Returns 0 or -ENOMEM. */
int incise_budget_columns(struct incise_budget_columns *to,
			  const struct incise_table_column *columns, int n,
			  enum incise_export_uncertainty uncertainty);

void incise_budget_cells(const struct incise_budget_columns *columns,
			 const double part[INCISE_BUDGET_PARTS],
			 union incise_cell *cells);

/* Twelve bits of an uncertainty are enough, and make a file that is smaller and faster to write. */
double incise_coarse(double u);

/* The words of correlation of a part: of whom else it is the error. */
extern const char *const incise_budget_correlations[];

/* --- export.c ---------------------------------------------------------------------- */

/* Returns 0 or -EINVAL. */
int incise_export_check(const struct incise_export_options *options,
			struct incise_error *err);

/*
 * Write what incise_export() does as a table of this format; the options were checked.
 * @provenance and @report may be NULL. Returns 0 or -errno.
 */
int incise_export_table(struct incise_recording *const *recordings, int n,
			const struct incise_export_options *options,
			const struct incise_table_format *format, FILE *out,
			const struct incise_provenance *provenance,
			struct incise_export_report *report, struct incise_error *err);

/* Say in a report which uncertainties are not stated, each cause once. */
void incise_report_unstated(struct incise_export_report *report,
			    const struct incise_budget *budget);

/* --- resample.c -------------------------------------------------------------------- */

/*
 * All of a recording on one grid of time, or at the times of the force samples: force, pose of
 * the blade, depth and speed, depth by the camera, each with its uncertainty and flags. The last
 * columns are of the camera.
 */
#define INCISE_RESAMPLE_COLUMNS 25
#define INCISE_RESAMPLE_CAMERA_COLUMNS 5

extern const struct incise_table_column
	incise_resample_columns[INCISE_RESAMPLE_COLUMNS + INCISE_RESAMPLE_CAMERA_COLUMNS];

/* Number of columns for these recordings: 25 or 30, or -errno. */
int incise_resample_width(struct incise_recording *const *recordings, int n,
			  struct incise_error *err);

/*
 * Add the rows of a recording under a name, with TAI if @wall is not NULL, with uncertainties if
 * @budget is not. For the progress, @samples of force were read
 * before, of @all. Returns 0 or -errno.
 */
int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
		    const struct incise_budget *budget,
		    const struct incise_budget_columns *columns,
		    const struct incise_wall *wall, struct incise_table *table,
		    struct incise_export_report *report, uint64_t samples, uint64_t all,
		    struct incise_error *err);

/* --- export_mcap.c ----------------------------------------------------------------- */

/*
 * A recording as messages for viewers: every row of force, tracker, depth and events, in order
 * of time, log_time = t_ns (CLOCK_MONOTONIC). Rows of the report are messages. Returns 0,
 * -EINVAL, -EIO, -ENOSPC, -ENOMEM, -EINTR.
 */
int incise_export_mcap(struct incise_recording *recording,
		       const struct incise_export_options *options, FILE *out,
		       const struct incise_provenance *provenance,
		       struct incise_export_report *report, struct incise_error *err);

#endif
