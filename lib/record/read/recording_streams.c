// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Tables streams and knots of a recording; see recording.h. Nothing in them is trusted.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "recording.h"
#include "../schema.h"

/* 146 years: times and their differences stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
#define COUNT_MAX (1LL << 53)

static int damaged(struct incise_recording *rec, const char *table, const char *what,
		   struct incise_error *err)
{
	return incise_error_set(err, EINVAL, "%s: damaged: table %s: %s", rec->path,
				table, what);
}

/* A text without what a terminal would take for a command. */
static bool take_text(sqlite3_stmt *stmt, int column, char *to, size_t size)
{
	/* Before the text is asked for, which makes one of anything. */
	int type = sqlite3_column_type(stmt, column);
	const char *text = (const char *)sqlite3_column_text(stmt, column);

	if (type == SQLITE_NULL)
		text = "";
	else if (type != SQLITE_TEXT || !text)
		return false;
	snprintf(to, size, "%s", text);
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	return true;
}

static bool take_count(sqlite3_stmt *stmt, int column, uint64_t *to)
{
	int64_t value = sqlite3_column_int64(stmt, column);

	*to = value;
	return sqlite3_column_type(stmt, column) == SQLITE_INTEGER && value >= 0 &&
	       value <= COUNT_MAX;
}

/* A number, or NULL for one that is not known. */
static bool take_known(sqlite3_stmt *stmt, int column, double scale, double *to)
{
	int type = sqlite3_column_type(stmt, column);

	*to = type == SQLITE_NULL ? NAN : sqlite3_column_double(stmt, column) * scale;
	return type == SQLITE_NULL ||
	       ((type == SQLITE_FLOAT || type == SQLITE_INTEGER) && isfinite(*to));
}

static bool take_stream(sqlite3_stmt *stmt, struct incise_stream *stream)
{
	struct incise_stream *s = stream;

	s->stamped = sqlite3_column_int(stmt, 2);
	return take_text(stmt, 0, s->name, sizeof(s->name)) && *s->name &&
	       take_text(stmt, 1, s->device, sizeof(s->device)) &&
	       take_known(stmt, 3, 1, &s->nominal_hz) &&
	       take_known(stmt, 4, 1e-6, &s->delay_ms) &&
	       take_known(stmt, 5, 1e-6, &s->delay_sd_ms) &&
	       take_count(stmt, 6, &s->rows) && take_count(stmt, 7, &s->lost) &&
	       take_count(stmt, 8, &s->late) && take_known(stmt, 9, 1, &s->rate_hz) &&
	       take_known(stmt, 10, 1, &s->drift_ppm) &&
	       take_known(stmt, 11, 1, &s->drift_sd_ppm) &&
	       take_known(stmt, 12, 1e-6, &s->jitter_ms) &&
	       take_known(stmt, 13, 1e-6, &s->jitter_max_ms) &&
	       take_known(stmt, 14, 1e-6, &s->offset_ms) &&
	       take_known(stmt, 15, 1e-6, &s->offset_sd_ms) &&
	       take_text(stmt, 16, s->ended, sizeof(s->ended));
}

int incise_recording_streams(struct incise_recording *rec,
			     struct incise_stream streams[INCISE_STREAMS_MAX],
			     struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int n = 0, rc;

	if (rec->form < 2)
		return 0;
	if (sqlite3_prepare_v2(
		    rec->db,
		    "SELECT name, device, stamped, nominal_hz, delay_ns, delay_sd_ns, "
		    "rows, lost, late, rate_hz, drift_ppm, drift_sd_ppm, jitter_ns, "
		    "jitter_max_ns, offset_ns, offset_sd_ns, ended FROM streams ORDER BY "
		    "rowid",
		    -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW && n < INCISE_STREAMS_MAX)
		if (!take_stream(stmt, &streams[n++])) {
			n = damaged(rec, "streams", "a value is none that it can have",
				    err);
			sqlite3_finalize(stmt);
			return n;
		}
	if (rc == SQLITE_ROW)
		n = damaged(rec, "streams", "more rows than there are streams", err);
	else if (rc != SQLITE_DONE)
		n = incise_schema_fail(rec->db, rec->path, err);
	sqlite3_finalize(stmt);
	return n;
}

static bool take_knot(sqlite3_stmt *stmt, const struct incise_timeline_knot *last,
		      struct incise_timeline_knot *knot)
{
	int64_t seq = sqlite3_column_int64(stmt, 0);

	knot->seq = seq;
	knot->t_ns = sqlite3_column_int64(stmt, 1);
	knot->sd_ns = sqlite3_column_double(stmt, 2);
	knot->starts = sqlite3_column_int(stmt, 3);
	return sqlite3_column_type(stmt, 0) == SQLITE_INTEGER && seq >= 0 &&
	       sqlite3_column_type(stmt, 1) == SQLITE_INTEGER &&
	       knot->t_ns >= -TIME_MAX && knot->t_ns <= TIME_MAX &&
	       sqlite3_column_type(stmt, 2) == SQLITE_FLOAT && knot->sd_ns >= 0 &&
	       knot->sd_ns < 1e18 &&
	       (!last || (knot->seq > last->seq && knot->t_ns > last->t_ns));
}

int incise_recording_line(struct incise_recording *rec, const char *stream,
			  struct incise_recording_line *line, struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int rc;

	line->n = 0;
	if (rec->form < 2)
		return 0;
	if (sqlite3_prepare_v2(rec->db,
			       "SELECT seq, t_ns, sd_ns, begins FROM knots WHERE stream "
			       "= ? ORDER BY knot",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_STATIC);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		int n = line->n;

		if (n == INCISE_TIMELINE_KNOTS_MAX ||
		    !take_knot(stmt, n ? &line->knots[n - 1] : NULL, &line->knots[n])) {
			sqlite3_finalize(stmt);
			return damaged(rec, "knots", "a row is none that a line can have",
				       err);
		}
		line->n++;
	}
	if (rc != SQLITE_DONE) {
		rc = incise_schema_fail(rec->db, rec->path, err);
		sqlite3_finalize(stmt);
		return rc;
	}
	sqlite3_finalize(stmt);
	if (line->n < 2)
		line->n = 0;
	return 0;
}

int64_t incise_recording_time(const struct incise_recording_line *line, uint64_t seq,
			      int64_t t_ns)
{
	return line->n ? incise_timeline_at(line->knots, line->n, seq) : t_ns;
}

double incise_recording_time_sd(const struct incise_recording_line *line, uint64_t seq)
{
	return line->n ? incise_timeline_sd(line->knots, line->n, seq) : NAN;
}
