/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The rows of one of a recording's tables, in order, and the best time of each, ns of
 * CLOCK_MONOTONIC. The file is untrusted: an impossible or a missing row ends it with an error.
 *
 *     row's own t_ns │ │  │ │ │   found while recording, from the samples so far
 *     best time      ╱ ╱  ╱ ╱ ╱   on the line through all samples, if the stream has one
 *
 * The best time is less the delay of another calibration, if one is given. Times increase from
 * row to row, whatever rows and knots contain; a delay can make them negative.
 */
#ifndef INCISE_ROWS_H
#define INCISE_ROWS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include "../../signal/fit.h"
#include "source.h"

/* --- the clock of a session -------------------------------------------------------------- */

/*
 *     session's clock              ╱─ knots, straight lines between them; beyond the ends the
 *     (the first member's)   ╱───╱    line goes on
 *                        ───╱
 *                     member's CLOCK_MONOTONIC
 */
struct incise_session_knot {
	int64_t t_ns, to_ns; /* both increase */
	double bound_ns;     /* of the error, with the first member's */
};

struct incise_session_map {
	struct incise_session_knot *knots;
	size_t n; /* 2 or more */
};

/* A time of a member's clock on the session's, ns; without a map the same. */
int64_t incise_session_time(const struct incise_session_map *map, int64_t t_ns);

/* And back. */
int64_t incise_session_member_time(const struct incise_session_map *map, int64_t t_ns);

/* Bound of its error, ns. */
double incise_session_bound(const struct incise_session_map *map, int64_t t_ns);

/* --- times ------------------------------------------------------------------------- */

#define INCISE_TIME_NONE INT64_MIN /* before any row */

struct incise_row_times {
	const struct incise_stream_source *source; /* NULL: of events */
	struct incise_others *others; /* rows that are timed otherwise, or NULL */
	/* As the source has it, or by another calibration. */
	int64_t shift_ns;
	double variance_ns2;
	bool may_repeat;		      /* equal times are allowed */
	int64_t own_ns, last_ns;	      /* of the row before */
	const struct incise_session_map *map; /* to the clock of a session, or NULL */
	int64_t least_ns;		      /* of own times */
};

/* For a table of a recording. Returns 0 or -errno. */
int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err);

void incise_row_times_close(struct incise_row_times *times);

/* Use the delay of another calibration, if it has one for this stream; before the first row. */
void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration);

/* Time of the next row, to @best_ns; false: its own is impossible or does not increase. */
bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns);

/*
 * The time of a row as it was recorded, on the line or without a line its own, and its standard uncertainty; NAN: not
 * known.
 */
int64_t incise_row_times_line(const struct incise_row_times *times, uint64_t seq,
			      int64_t t_ns);
double incise_row_times_line_sd(const struct incise_row_times *times, uint64_t seq);

/* The first row from a number on that is not on the line of the tracker, or NULL. */
const struct incise_fit_time *incise_row_times_other(const struct incise_row_times *times,
						     uint64_t seq);

/* Its standard uncertainty, s; 0 if it is not known. */
double incise_row_times_sd(const struct incise_row_times *times, int64_t seq);

/*
 * Share of the way from the time of one row to that of another; NAN if a time is missing, t is
 * before the first, or they are further apart than INCISE_DEPTH_GAP_NS.
 */
double incise_row_share(int64_t a_ns, int64_t b_ns, int64_t t_ns);

/* --- rows -------------------------------------------------------------------------- */

#define INCISE_ROWS_COLUMNS 14

struct incise_rows {
	struct incise_recording *recording;
	const char *table;
	struct incise_source source; /* of a stream */
	size_t at;		     /* of its batch */
	int column
		[INCISE_ROWS_COLUMNS]; /* of the batch, in the order that was asked for */
	sqlite3_stmt *stmt;	       /* of events: at the row */
	uint64_t n, expected;
	int64_t begin_ns, end_ns;  /* own times of rows; one behind is read */
	int64_t every_ns, pass_ns; /* of an overview: the own time of the next block */
	int64_t t_ns;		   /* best time of the row; its own is in column t_ns */
	struct incise_row_times times;
	bool live; /* there is a row */
	bool ended;
};

/*
 * Open a table for columns, by their names with ", " between them. Times increase; those of events,
 * which have columns rowid, t_ns, kind and text, may repeat. Table depth has the columns x_mm to qz of
 * the tracker's record too. @expected UINT64_MAX: the table's size is not known. Returns 0 or -errno.
 */
int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, uint64_t expected,
		     struct incise_error *err);

/* Time of the first sample of the table, whatever the range; before the first row. 0, or -errno. */
int incise_rows_first(const struct incise_rows *rows, int64_t *first_ns,
		      struct incise_error *err);

/* Go to the next row: 1, 0 at the end, -EINVAL (an impossible or missing row), -EIO. */
int incise_rows_next(struct incise_rows *rows, struct incise_error *err);

/*
 * Values of the row, by the place of the column in the list that was asked for: an integer; a real, NAN
 * where the table has none; the tracker's status; a text of events, with its length in bytes unless @n
 * is NULL, until the next row.
 */
int64_t incise_rows_int(const struct incise_rows *rows, int column);
double incise_rows_real(const struct incise_rows *rows, int column);
char incise_rows_char(const struct incise_rows *rows, int column);
const char *incise_rows_text(const struct incise_rows *rows, int column, size_t *n);

/* The row's number, for messages; of events their rowid. */
int64_t incise_rows_seq(const struct incise_rows *rows);

void incise_rows_close(struct incise_rows *rows);

#endif
