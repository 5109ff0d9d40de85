/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * All of a recording on one grid of time, or on the times of the force samples: force,
 * pose of the blade, depth and speed, each with what is to be known of its worth.
 *
 *     force    │││││││││││││││││   weighted by  ╱▔╲  around the row's time
 *     tracker  │      │      │     position linear, orientation slerp
 *     row             ▲
 */
#ifndef INCISE_RESAMPLE_H
#define INCISE_RESAMPLE_H

#include <incise/recording.h>
#include "table_writer.h"

#define INCISE_RESAMPLE_COLUMNS 17

extern const struct incise_column incise_resample_columns[INCISE_RESAMPLE_COLUMNS];

/*
 * Weight of a force sample that is so many rows away from the row: a sinc with its -6 dB
 * at a third of the rate of rows, under Blackman's window of 8 rows to each side. Even,
 * so that phase and delay are 0; the weights are divided by their sum, so that a constant
 * comes out as it is. From half the rate of rows on, where aliases would begin, less than
 * 1e-3 is let through.
 */
double incise_resample_weight(double rows);

/*
 * Add the rows of a recording under a name. @samples is of force, gone through before, and
 * @all to go through, for options->progress. Returns 0 or -errno.
 */
int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
		    struct incise_table *table, struct incise_export_report *report,
		    uint64_t samples, uint64_t all, struct incise_error *err);

#endif
