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
			INCISE_COLUMN_FLAG, 0                          \
	}

/* --- columns_tai.c ------------------------------------------------------------------ */

#define INCISE_TAI_COLUMNS 2

/* A copy of columns, to be freed, with those of TAI behind them. NULL: no memory. */
struct incise_column *incise_tai_columns(const struct incise_column *columns, int n);

/* Their cells at a time of CLOCK_MONOTONIC; the mapping must reach to it. Returns 0 or -ENODATA. */
int incise_tai_cells(const struct incise_wall *wall, int64_t t_ns,
		     union incise_cell cells[INCISE_TAI_COLUMNS],
		     struct incise_error *err);

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

/* --- resample.c -------------------------------------------------------------------- */

/*
 * All of a recording on one grid of time, or at the times of the force samples: force, pose of
 * the blade, depth and speed, depth by the camera, each with its uncertainty and flags. The last
 * columns are of the camera.
 */
#define INCISE_RESAMPLE_COLUMNS 25
#define INCISE_RESAMPLE_CAMERA_COLUMNS 5

extern const struct incise_column
	incise_resample_columns[INCISE_RESAMPLE_COLUMNS + INCISE_RESAMPLE_CAMERA_COLUMNS];

/* Number of columns for these recordings: 25 or 30, or -errno. */
int incise_resample_width(struct incise_recording *const *recordings, int n,
			  struct incise_error *err);

/*
 * Add the rows of a recording under a name, with TAI if @wall is not NULL. For the progress, @samples of force were read
 * before, of @all. Returns 0 or -errno.
 */
int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
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
