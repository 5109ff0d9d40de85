// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a table and their best times; see rows.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "depth.h"
#include "recalibration.h"
#include "rows.h"
#include "session.h"
#include "../schema.h"

/* --- times ------------------------------------------------------------------------- */

#define TIME_MAX (INT64_MAX / 4) /* 73 years; sums and differences do not overflow */
#define DELAY_MAX_NS 1e12	 /* a quarter of an hour; shifts do not overflow */

static const struct {
	const char *table, *stream;
} streams[] = {
	{"force", "force"},
	{"tracker", "tracker"},
	{"depth", "tracker"}, /* rows have the number of the tracker's record */
	{"frames", "camera"},
};

int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err)
{
	struct incise_stream known[INCISE_STREAMS_MAX];
	int rc = 0, n;

	recording = incise_recording_member(recording, table);
	*times = (struct incise_row_times){
		.may_repeat = true,
		.delay_ns = NAN,
		.own_ns = -TIME_MAX - 1,
		.last_ns = INCISE_TIME_NONE,
		.map = recording->map,
		/* Events of a session are on its clock already. */
		.least_ns = recording->session ? -TIME_MAX : 0,
	};
	for (size_t i = 0; i < sizeof(streams) / sizeof(*streams); i++)
		if (!strcmp(streams[i].table, table))
			times->stream = streams[i].stream;
	if (!times->stream)
		return 0; /* events */
	times->may_repeat = false;
	/* For recordings without a table of streams. */
	if (!strcmp(times->stream, "tracker"))
		rc = incise_recording_number(recording, "tracker_latency_ns",
					     &times->delay_ns, err);
	if (rc)
		return rc;
	n = incise_recording_streams(recording, known, err);
	for (int i = 0; i < n; i++)
		if (!strcmp(known[i].name, times->stream)) {
			times->delay_ns = known[i].delay_ms * 1e6;
			times->delay_sd_ns = known[i].delay_sd_ms * 1e6;
			times->offset_sd_ns = known[i].offset_sd_ms * 1e6;
		}
	if (n < 0)
		return n;
	if (recording->recalibrated)
		incise_row_times_calibrate(times, &recording->recalibrated->calibration);
	return incise_recording_line(recording, times->stream, &times->line, err);
}

static double known(double value, double otherwise)
{
	return isnan(value) ? otherwise : value;
}

void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration)
{
	double ms = NAN, sd_ms = NAN, old_ns = known(times->delay_ns, 0);
	double old_sd_ns = known(times->delay_sd_ns, 0);

	if (!times->stream)
		return;
	if (!strcmp(times->stream, "force")) {
		ms = calibration->force_delay_ms;
		sd_ms = calibration->force_delay_sd_ms;
	} else if (!strcmp(times->stream, "tracker")) {
		ms = calibration->tracker_delay_ms;
		sd_ms = calibration->tracker_delay_sd_ms;
	} else {
		ms = calibration->camera_delay_ms;
		sd_ms = calibration->camera_delay_sd_ms;
	}
	if (isnan(ms))
		return;
	times->shift_ns =
		(int64_t)fmax(fmin(old_ns - ms * 1e6, DELAY_MAX_NS), -DELAY_MAX_NS);
	if (!isnan(sd_ms))
		times->variance_ns2 = sd_ms * 1e6 * sd_ms * 1e6 - old_sd_ns * old_sd_ns;
}

bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns)
{
	int64_t best;

	if (t_ns < times->least_ns || t_ns > TIME_MAX || t_ns < times->own_ns ||
	    (t_ns == times->own_ns && !times->may_repeat))
		return false;
	times->own_ns = t_ns;
	best = incise_recording_time(&times->line, seq, t_ns) + times->shift_ns;
	best = incise_session_time(times->map, best);
	best = best > TIME_MAX ? TIME_MAX : best < -TIME_MAX ? -TIME_MAX : best;
	if (times->last_ns != INCISE_TIME_NONE &&
	    best < times->last_ns + !times->may_repeat)
		best = times->last_ns + !times->may_repeat;
	times->last_ns = *best_ns = best;
	return true;
}

double incise_row_times_sd(const struct incise_row_times *times, int64_t seq)
{
	double on_line_ns = incise_recording_time_sd(&times->line, seq);
	double sd_ns = times->line.n ? on_line_ns
				     : known(times->offset_sd_ns, known(on_line_ns, 0));
	/* Of a bounded error that is as likely anywhere within. */
	double map_ns = times->map ? incise_session_bound(times->map, times->own_ns) : 0;
	double variance = sd_ns * sd_ns + times->variance_ns2 + map_ns * map_ns / 3;

	return variance > 0 ? sqrt(variance) * 1e-9 : 0;
}

double incise_row_share(int64_t a_ns, int64_t b_ns, int64_t t_ns)
{
	if (a_ns == INCISE_TIME_NONE || b_ns == INCISE_TIME_NONE || t_ns < a_ns ||
	    b_ns - a_ns > INCISE_DEPTH_GAP_NS)
		return NAN;
	return (double)(t_ns - a_ns) / (b_ns - a_ns);
}

/* --- rows -------------------------------------------------------------------------- */

int incise_rows_open_joined(struct incise_rows *rows, struct incise_recording *recording,
			    const char *table, const char *other, const char *columns,
			    const char *types, uint64_t expected,
			    struct incise_error *err)
{
	char sql[300];

	recording = incise_recording_member(recording, table);
	*rows = (struct incise_rows){
		.recording = recording,
		.table = table,
		.types = types,
		.other = other,
		.expected = expected,
		.t_ns = INCISE_TIME_NONE,
	};
	/* CROSS: SQLite keeps this order, and looks up the other table's rows by number. */
	if (other)
		snprintf(sql, sizeof(sql),
			 "SELECT %s FROM %s CROSS JOIN %s USING (seq) ORDER BY %s.seq",
			 columns, table, other, table);
	else
		snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY %s", columns,
			 table, strcmp(table, "events") ? "seq" : "t_ns, rowid");
	if (sqlite3_prepare_v2(recording->db, sql, -1, &rows->stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	return incise_row_times_open(&rows->times, recording, table, err);
}

int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, const char *types,
		     uint64_t expected, struct incise_error *err)
{
	return incise_rows_open_joined(rows, recording, table, NULL, columns, types,
				       expected, err);
}

static bool fits(sqlite3_stmt *stmt, int column, char type)
{
	int found = sqlite3_column_type(stmt, column);

	switch (type) {
	case 'i':
		return found == SQLITE_INTEGER;
	case 't':
		return found == SQLITE_TEXT;
	case 'n':
		if (found == SQLITE_NULL)
			return true;
		/* fall through */
	default:
		return found == SQLITE_FLOAT &&
		       isfinite(sqlite3_column_double(stmt, column));
	}
}

/* Check the row and find its time. */
static bool take(struct incise_rows *rows)
{
	for (int i = 0; rows->types[i]; i++)
		if (!fits(rows->stmt, i, rows->types[i]))
			return false;
	return incise_row_times_next(&rows->times, sqlite3_column_int64(rows->stmt, 0),
				     sqlite3_column_int64(rows->stmt, 1), &rows->t_ns);
}

int incise_rows_next(struct incise_rows *rows, struct incise_error *err)
{
	const char *path = rows->recording->path;
	int rc = sqlite3_step(rows->stmt);

	rows->live = false;
	if (rc == SQLITE_DONE) {
		if (rows->expected == UINT64_MAX || rows->n == rows->expected)
			return 0;
		return incise_error_set(
			err, EINVAL, "%s: damaged: table %s has %llu rows of %llu%s%s%s",
			path, rows->table, (unsigned long long)rows->n,
			(unsigned long long)rows->expected,
			rows->other ? " that table " : "", rows->other ? rows->other : "",
			rows->other ? " has too" : "");
	}
	if (rc != SQLITE_ROW)
		return incise_schema_fail(rows->recording->db, path, err);
	if (!take(rows))
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: table %s%s%s, row %lld is invalid; `sqlite3 "
			"%s/%s` shows it",
			path, rows->table, rows->other ? " or " : "",
			rows->other ? rows->other : "",
			(long long)sqlite3_column_int64(rows->stmt, 0), path,
			INCISE_SCHEMA_DB);
	rows->live = true;
	rows->n++;
	return 1;
}

void incise_rows_close(struct incise_rows *rows)
{
	sqlite3_finalize(rows->stmt);
	rows->stmt = NULL;
}
