/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recording that was opened for reading; for lib/record only.
 */
#ifndef INCISE_RECORDING_PRIVATE_H
#define INCISE_RECORDING_PRIVATE_H

#include <sqlite3.h>
#include <incise/recording.h>
#include "../time/timeline.h"

struct incise_recording {
	sqlite3 *db; /* read-only, in one transaction: a snapshot, even of a live one */
	char *path;  /* of the folder that was opened */
	char *name;  /* "liver" of dir/liver.rec and of dir/liver.rec.part */
	int form;    /* of its tables, see schema.h */
	uint64_t depth_rows;
	struct incise_recording_info meta; /* as far as the table `meta` says */
};

/* The line that gives a stream its times afterwards; n 0: its rows' own are the best. */
struct incise_recording_line {
	int n;
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
};

/* Table streams; a recording of form 1 has none. How many, -EINVAL (a row that cannot be). */
int incise_recording_streams(struct incise_recording *recording,
			     struct incise_stream streams[INCISE_STREAMS_MAX],
			     struct incise_error *err);

/* Table knots of one stream. 0, -EINVAL (a row that cannot be), -EIO. */
int incise_recording_line(struct incise_recording *recording, const char *stream,
			  struct incise_recording_line *line, struct incise_error *err);

/* The best time of a row, ns of CLOCK_MONOTONIC: on the line, or where there is none its own. */
int64_t incise_recording_time(const struct incise_recording_line *line, uint64_t seq,
			      int64_t t_ns);

/* Its standard uncertainty, ns; NAN where there is no line. */
double incise_recording_time_sd(const struct incise_recording_line *line, uint64_t seq);

#endif
