/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The best time of each row of a table, ns of CLOCK_MONOTONIC: on its stream's line where
 * there is one, else as it was written; less another calibration's delay, where one is
 * given.
 *
 *     row's own t_ns │ │  │ │ │   found while recording, from what had come by then
 *     line           ╱ ╱  ╱ ╱ ╱   drawn through all of it
 *
 * Times increase from row to row, whatever rows and knots say; they may be negative where a
 * delay takes them there.
 */
#ifndef INCISE_ROW_TIMES_H
#define INCISE_ROW_TIMES_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include "recording.h"

#define INCISE_TIME_NONE INT64_MIN /* before any row */

struct incise_row_times {
	struct incise_recording_line line;
	const char *stream;
	bool still;		      /* times may stand still */
	double delay_ns, delay_sd_ns; /* those taken off already; NAN: not known */
	double offset_sd_ns;	      /* of times without a line */
	double variance_ns2;	      /* another calibration's, more than that */
	int64_t shift_ns;
	int64_t own_ns, last_ns; /* of the row before */
};

/* For a table of a recording. Returns 0 or -errno. */
int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err);

/* Take the delay of another calibration, where it has one for this stream. */
void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration);

/* Time of the next row, to @best_ns; false: its own cannot be, as it does not increase. */
bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns);

/* Its standard uncertainty, s; 0 where nothing is known of it. */
double incise_row_times_sd(const struct incise_row_times *times, int64_t seq);

#endif
