// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a table; see rows.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include "rows.h"
#include "schema.h"

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
		.t_ns = -1,
	};
	snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY %s", columns, table,
		 expected == UINT64_MAX ? "t_ns, rowid" : "seq");
	if (sqlite3_prepare_v2(recording->db, sql, -1, &rows->stmt, NULL) == SQLITE_OK)
		return 0;
	return incise_schema_fail(recording->db, recording->path, err);
}

static bool good(const struct incise_rows *rows)
{
	int64_t t_ns = sqlite3_column_int64(rows->stmt, 1);

	for (int i = 0; rows->types[i]; i++) {
		int type = sqlite3_column_type(rows->stmt, i);

		if (rows->types[i] == 'i' ? type != SQLITE_INTEGER
		    : rows->types[i] == 't'
			    ? type != SQLITE_TEXT
			    : type != SQLITE_FLOAT ||
				      !isfinite(sqlite3_column_double(rows->stmt, i)))
			return false;
	}
	return t_ns > rows->t_ns ||
	       (rows->expected == UINT64_MAX && t_ns == rows->t_ns && t_ns >= 0);
}

int incise_rows_next(struct incise_rows *rows, struct incise_error *err)
{
	const char *path = rows->recording->path;
	int rc = sqlite3_step(rows->stmt);

	rows->live = false;
	if (rc == SQLITE_DONE) {
		if (rows->expected == UINT64_MAX || rows->n == rows->expected)
			return 0;
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s has %llu rows of %llu",
					path, rows->table, (unsigned long long)rows->n,
					(unsigned long long)rows->expected);
	}
	if (rc != SQLITE_ROW)
		return incise_schema_fail(rows->recording->db, path, err);
	if (!good(rows))
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: table %s, row %lld cannot be; `sqlite3 "
			"%s/%s` shows it",
			path, rows->table, (long long)sqlite3_column_int64(rows->stmt, 0),
			path, INCISE_SCHEMA_DB);
	rows->t_ns = sqlite3_column_int64(rows->stmt, 1);
	rows->live = true;
	rows->n++;
	return 1;
}

void incise_rows_close(struct incise_rows *rows)
{
	sqlite3_finalize(rows->stmt);
	rows->stmt = NULL;
}
