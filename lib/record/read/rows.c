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
#include "session_map.h"
#include "../schema.h"

/* --- times ------------------------------------------------------------------------- */

#define TIME_MAX (INT64_MAX / 4) /* 73 years; sums and differences do not overflow */

int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err)
{
	const int stream = incise_source_find(table);
	struct incise_stream_source *source;
	int rc;

	*times = (struct incise_row_times){
		.may_repeat = true,
		.own_ns = -TIME_MAX - 1,
		.last_ns = INCISE_TIME_NONE,
		.map = recording->own->map,
		/* Events of a session are on its clock already. */
		.least_ns = recording->session ? -TIME_MAX : 0,
	};
	if (stream < 0)
		return 0;
	source = incise_source_stream(recording, stream);
	times->may_repeat = false;
	times->map = source->map;
	times->least_ns = 0;
	rc = incise_stream_resolve(source, err);
	if (rc)
		return rc;
	times->source = source;
	times->shift_ns = source->shift_ns;
	times->variance_ns2 = source->variance_ns2;
	if (source->period_ns > 0)
		times->others = incise_others_new(source);
	return source->period_ns > 0 && !times->others
		       ? incise_error_set(err, ENOMEM, "%s: out of memory",
					  recording->path)
		       : 0;
}

void incise_row_times_close(struct incise_row_times *times)
{
	incise_others_free(times->others);
	times->others = NULL;
}

void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration)
{
	if (times->source)
		incise_recalibration_shift(calibration, times->source, &times->shift_ns,
					   &times->variance_ns2);
}

/* The row among the others, or NULL. */
static const struct incise_fit_time *find_other(const struct incise_row_times *times,
						uint64_t seq)
{
	return times->others ? incise_others_find(times->others, seq) : NULL;
}

int64_t incise_row_times_line(const struct incise_row_times *times, uint64_t seq,
			      int64_t t_ns)
{
	const struct incise_fit_time *other = find_other(times, seq);
	const int n = times->source ? times->source->n_knots : 0;

	if (other)
		return n ? other->t_ns : t_ns - llrint(other->held_ns);
	return n ? incise_timeline_at(times->source->knots, n, seq) : t_ns;
}

double incise_row_times_line_sd(const struct incise_row_times *times, uint64_t seq)
{
	const struct incise_fit_time *other = find_other(times, seq);
	const int n = times->source ? times->source->n_knots : 0;

	if (other)
		return other->sd_ns;
	return n ? incise_timeline_sd(times->source->knots, n, seq) : NAN;
}

bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns)
{
	int64_t best;

	if (t_ns < times->least_ns || t_ns > TIME_MAX || t_ns < times->own_ns ||
	    (t_ns == times->own_ns && !times->may_repeat))
		return false;
	times->own_ns = t_ns;
	best = incise_row_times_line(times, seq, t_ns) + times->shift_ns;
	best = incise_session_time(times->map, best);
	best = best > TIME_MAX ? TIME_MAX : best < -TIME_MAX ? -TIME_MAX : best;
	if (times->last_ns != INCISE_TIME_NONE &&
	    best < times->last_ns + !times->may_repeat)
		best = times->last_ns + !times->may_repeat;
	times->last_ns = *best_ns = best;
	return true;
}

static double known(double value, double otherwise)
{
	return isnan(value) ? otherwise : value;
}

double incise_row_times_sd(const struct incise_row_times *times, int64_t seq)
{
	const struct incise_stream_source *source = times->source;
	double on_line_ns = incise_row_times_line_sd(times, seq);
	double sd_ns =
		source && source->n_knots
			? on_line_ns
			: known(source ? source->offset_sd_ns : 0, known(on_line_ns, 0));
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

#define EVENTS "rowid, t_ns, kind, text"

/* The place of a name in a list with ", " between. */
static int place_of(const char *list, const char *name, size_t length)
{
	int i = 0;

	while (strncmp(list, name, length) || (list[length] != ',' && list[length])) {
		list = strchr(list, ' ') + 1;
		i++;
	}
	return i;
}

int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, uint64_t expected,
		     struct incise_error *err)
{
	const int stream = incise_source_find(table);
	const char *all = stream < 0 ? EVENTS : incise_source_form(stream)->columns;
	int rc, n = 0;

	if (stream >= 0)
		recording = incise_source_stream(recording, stream)->file;
	*rows = (struct incise_rows){
		.recording = recording,
		.table = table,
		/* An interrupted recording has counted fewer depths than its poses give. */
		.expected = stream == INCISE_SOURCE_DEPTH || recording->range.limited
				    ? UINT64_MAX
				    : expected,
		.begin_ns =
			recording->range.limited ? recording->range.begin_ns : INT64_MIN,
		.end_ns = recording->range.limited ? recording->range.end_ns : INT64_MAX,
		.t_ns = INCISE_TIME_NONE,
	};
	for (const char *name = columns; *name && n < INCISE_ROWS_COLUMNS;) {
		size_t length = strcspn(name, ",");

		rows->column[n++] = place_of(all, name, length);
		name += length + strspn(name + length, ", ");
	}
	if (stream >= 0)
		rc = incise_source_open_at(
			&rows->source, recording, stream,
			recording->range.limited
				? incise_source_seek(recording, table,
						     recording->range.begin_ns)
				: INT64_MIN,
			err);
	else
		rc = sqlite3_prepare_v2(recording->db,
					"SELECT " EVENTS
					" FROM events ORDER BY t_ns, rowid",
					-1, &rows->stmt, NULL) == SQLITE_OK
			     ? 0
			     : incise_schema_fail(recording->db, recording->path, err);
	return rc ? rc : incise_row_times_open(&rows->times, recording, table, err);
}

/* To the next row of the batch, of the next batch, or of events: 1, 0, -errno. */
static int step(struct incise_rows *rows, struct incise_error *err)
{
	int rc;

	if (!rows->stmt) {
		if (rows->live && ++rows->at < rows->source.batch.n)
			return 1;
		rows->at = 0;
		return incise_source_next(&rows->source, err);
	}
	rc = sqlite3_step(rows->stmt);
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		return incise_schema_fail(rows->recording->db, rows->recording->path,
					  err);
	return rc == SQLITE_ROW;
}

static int64_t own_ns(const struct incise_rows *rows)
{
	return rows->stmt ? sqlite3_column_int64(rows->stmt, 1)
			  : rows->source.batch.column[1].i[rows->at];
}

int incise_rows_first(const struct incise_rows *rows, int64_t *first_ns,
		      struct incise_error *err)
{
	struct incise_row_times times = rows->times; /* as before the first row */
	int64_t seq = 0, t_ns = 0;
	int rc = incise_source_end(rows->recording, rows->table, false, &seq, &t_ns, NULL,
				   err);

	if (rc > 0 && !incise_row_times_next(&times, seq, t_ns, first_ns))
		*first_ns = t_ns; /* reading the row reports the damage */
	return rc < 0 ? rc : 0;
}

/* Of events no other than these types; of a stream the batch has checked them. */
static bool take(struct incise_rows *rows)
{
	if (rows->stmt && (sqlite3_column_type(rows->stmt, 1) != SQLITE_INTEGER ||
			   sqlite3_column_type(rows->stmt, 2) != SQLITE_TEXT ||
			   sqlite3_column_type(rows->stmt, 3) != SQLITE_TEXT))
		return false;
	return incise_row_times_next(&rows->times, incise_rows_seq(rows), own_ns(rows),
				     &rows->t_ns);
}

int incise_rows_next(struct incise_rows *rows, struct incise_error *err)
{
	const char *path = rows->recording->path;
	int rc = 0;

	/* Behind the end another step would begin anew, or go on behind a range. */
	rows->ended |= rows->live && own_ns(rows) > rows->end_ns;
	if (!rows->ended)
		rc = step(rows, err);

	/* Of the first block, or of what a filter needs. */
	while (rc > 0 && own_ns(rows) < rows->begin_ns) {
		rows->live = true;
		rc = step(rows, err);
	}
	rows->live = false;
	rows->ended |= !rc;
	if (rc < 0)
		return rc;
	if (!rc) {
		if (rows->expected == UINT64_MAX || rows->n == rows->expected)
			return 0;
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s has %llu rows of %llu",
					path, rows->table, (unsigned long long)rows->n,
					(unsigned long long)rows->expected);
	}
	/* A row that cannot be is passed, as a block is. */
	rows->live = true;
	if (!take(rows))
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: table %s, row %lld: its time is "
			"impossible; `incise verify %s` lists what is damaged",
			path, rows->table, (long long)incise_rows_seq(rows), path);
	rows->n++;
	return 1;
}

int64_t incise_rows_int(const struct incise_rows *rows, int column)
{
	const int at = rows->column[column];

	return rows->stmt ? sqlite3_column_int64(rows->stmt, at)
			  : rows->source.batch.column[at].i[rows->at];
}

double incise_rows_real(const struct incise_rows *rows, int column)
{
	return rows->source.batch.column[rows->column[column]].r[rows->at];
}

char incise_rows_char(const struct incise_rows *rows, int column)
{
	return rows->source.batch.column[rows->column[column]].c[rows->at];
}

const char *incise_rows_text(const struct incise_rows *rows, int column, size_t *n)
{
	const int at = rows->column[column];

	if (n)
		*n = sqlite3_column_bytes(rows->stmt, at);
	return (const char *)sqlite3_column_text(rows->stmt, at);
}

int64_t incise_rows_seq(const struct incise_rows *rows)
{
	return rows->stmt ? sqlite3_column_int64(rows->stmt, 0)
			  : rows->source.batch.column[0].i[rows->at];
}

void incise_rows_close(struct incise_rows *rows)
{
	incise_source_close(&rows->source);
	incise_row_times_close(&rows->times);
	sqlite3_finalize(rows->stmt);
	rows->stmt = NULL;
}
