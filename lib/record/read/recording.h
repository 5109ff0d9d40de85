/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recording that was opened for reading; for lib/record only.
 */
#ifndef INCISE_RECORDING_PRIVATE_H
#define INCISE_RECORDING_PRIVATE_H

#include <sqlite3.h>
#include <incise/recording.h>
#include "others.h"
#include "range.h"
#include "../time/timeline.h"

struct incise_recalibrated;
struct incise_session;
struct incise_session_map;

struct incise_recording {
	sqlite3 *db; /* read-only, in one transaction: a snapshot, even of a live one */
	char *path;  /* of the folder that was opened */
	char *name;  /* "liver" of dir/liver.rec and of dir/liver.rec.part */
	int form;    /* of its tables, see schema.h */
	struct incise_recording_info meta; /* the part that is in table meta */
	/* The calibration that it is read by, if not that of its capture; see recalibration.h. */
	struct incise_recalibrated *recalibrated;
	struct incise_recording_range range; /* of rows that are opened */
	/* Of a session: its members; then db has the events only, and path the choice too. */
	struct incise_session *session;
	/* Of a member: from its clock to the session's; it belongs to the session. Or NULL. */
	const struct incise_session_map *map;
};

/* The same as incise_recording_open(), and a session without a choice: of any of its members. */
struct incise_recording *incise_recording_open_any(const char *path,
						   struct incise_error *err);

/* The same, as it was recorded: by the calibration of its capture. Members of a session are not. */
struct incise_recording *incise_recording_open_original(const char *path,
							struct incise_error *err);

/*
 * Convert the recording in a folder, which is a copy, to today's format, if it has an older one; @path is that
 * which was copied. Returns as incise_recording_recover().
 */
int incise_recording_convert(const char *folder, const char *path, bool damaged,
			     struct incise_recovered *made, struct incise_error *err);

/* The folder of a recording, path or path.part; to be freed; NULL with ENOENT, ENOMEM. */
char *incise_recording_folder(const char *path, struct incise_error *err);

/* Whether a recorder holds the lock of the folder. */
bool incise_recording_is_written(const char *folder);

/* The recording that has the rows of a table: a member, or the recording itself. */
struct incise_recording *incise_recording_member(const struct incise_recording *recording,
						 const char *table);

/*
 * A number of table meta, NAN if it is missing, NULL or no number. Returns 0, or -errno if the
 * table cannot be read.
 */
int incise_recording_number(struct incise_recording *recording, const char *key,
			    double *value, struct incise_error *err);

/* The converter's codes as forces: code · n_per_code - zero_N. */
struct incise_recording_force {
	double n_per_code, zero_N; /* zero NAN: not known */
	int32_t top;		   /* largest code */
};

/* By the recording's own calibration, or by @given if that is not NULL. */
void incise_recording_force(const struct incise_recording *recording,
			    const struct incise_calibration *given,
			    struct incise_recording_force *force);

/* Whether it had a force channel: a tracker alone has none. */
bool incise_recording_has_force(const struct incise_recording *recording);

/* Returns 0; -EINVAL: the zero is not known; -ENODATA: no force channel. */
int incise_recording_need_zero(const struct incise_recording *recording,
			       const struct incise_recording_force *force,
			       struct incise_error *err);

/* The line of a stream's times; n 0: the times of the rows are the best, but for the others. */
struct incise_recording_line {
	int n;
	struct incise_others *others; /* rows that are timed otherwise, or NULL */
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
};

/* Table streams; form 1 has none. Returns their number, -EINVAL (an impossible row). */
int incise_recording_streams(struct incise_recording *recording,
			     struct incise_stream streams[INCISE_STREAMS_MAX],
			     struct incise_error *err);

/*
 * Table knots of one stream. Returns 0, -EINVAL (an impossible row), -EIO. To be freed; copies share what is
 * freed.
 */
int incise_recording_line(struct incise_recording *recording, const char *stream,
			  struct incise_recording_line *line, struct incise_error *err);

void incise_recording_line_free(struct incise_recording_line *line);

/* The best time of a row, ns of CLOCK_MONOTONIC: on the line, or without a line its own. */
int64_t incise_recording_time(const struct incise_recording_line *line, uint64_t seq,
			      int64_t t_ns);

/* Its standard uncertainty, ns; NAN: not known. */
double incise_recording_time_sd(const struct incise_recording_line *line, uint64_t seq);

#endif
