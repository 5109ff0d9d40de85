// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a table; see rows.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "rows.h"
#include "../schema.h"

static int open_sql(struct incise_rows *rows, const char *sql, struct incise_error *err)
{
	struct incise_recording *recording = rows->recording;

	if (sqlite3_prepare_v2(recording->db, sql, -1, &rows->stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	return incise_row_times_open(&rows->times, recording, rows->table, err);
}

int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, const char *types,
		     uint64_t expected, struct incise_error *err)
{
	char sql[300];

	*rows = (struct incise_rows){
		.recording = recording,
		.table = table,
		.types = types,
		.expected = expected,
		.t_ns = INCISE_TIME_NONE,
	};
	snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY %s", columns, table,
		 strcmp(table, "events") ? "seq" : "t_ns, rowid");
	return open_sql(rows, sql, err);
}

int incise_rows_open_joined(struct incise_rows *rows, struct incise_recording *recording,
			    const char *table, const char *other, const char *columns,
			    const char *types, uint64_t expected,
			    struct incise_error *err)
{
	char sql[300];

	*rows = (struct incise_rows){
		.recording = recording,
		.table = table,
		.types = types,
		.other = other,
		.expected = expected,
		.t_ns = INCISE_TIME_NONE,
	};
	/* CROSS: SQLite keeps this order, and looks the other's rows up by their number. */
	snprintf(sql, sizeof(sql),
		 "SELECT %s FROM %s CROSS JOIN %s USING (seq) ORDER BY %s.seq", columns,
		 table, other, table);
	return open_sql(rows, sql, err);
}

void incise_rows_calibrate(struct incise_rows *rows,
			   const struct incise_calibration *calibration)
{
	incise_row_times_calibrate(&rows->times, calibration);
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
			"%s: damaged: table %s%s%s, row %lld cannot be; `sqlite3 "
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
