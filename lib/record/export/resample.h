/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * All of a recording on one grid of time, or on the times of the force samples: force,
 * pose of the blade, depth and speed, what the camera saw, each with what is to be known of
 * its worth.
 *
 *     force    │││││││││││││││││   force_near.h
 *     tracker  │      │      │     blade.h
 *     camera     │        │        camera_near.h
 *     row             ▲
 */
#ifndef INCISE_RESAMPLE_H
#define INCISE_RESAMPLE_H

#include <incise/recording.h>
#include "table_writer.h"

/* The last five are there where there are pictures. */
#define INCISE_RESAMPLE_COLUMNS 21
#define INCISE_RESAMPLE_CAMERA_COLUMNS 5

extern const struct incise_column
	incise_resample_columns[INCISE_RESAMPLE_COLUMNS + INCISE_RESAMPLE_CAMERA_COLUMNS];

/* How many columns recordings have: 21 or 26, or -errno. */
int incise_resample_width(struct incise_recording *const *recordings, int n,
			  struct incise_error *err);

/*
 * Add the rows of a recording under a name. @samples is of force, gone through before, and
 * @all to go through, for options->progress. Returns 0 or -errno.
 */
int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
		    struct incise_table *table, struct incise_export_report *report,
		    uint64_t samples, uint64_t all, struct incise_error *err);

#endif
