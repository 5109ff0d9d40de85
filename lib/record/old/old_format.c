// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Tables and rows of formats 1 to 4; see old.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../schema.h"
#include "old.h"

#define FRAMES                                                                        \
	"CREATE TABLE frames(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "        \
	"arrival_ns INTEGER NOT NULL, pts INTEGER NOT NULL, bytes INTEGER NOT NULL, " \
	"crc INTEGER NOT NULL, length_px REAL, sd_px REAL, depth_mm REAL, "           \
	"quality REAL"
#define TRACKER                                                                 \
	"CREATE TABLE tracker(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, " \
	"arrival_ns INTEGER NOT NULL, x_mm REAL NOT NULL, y_mm REAL NOT NULL, " \
	"z_mm REAL NOT NULL, qw REAL NOT NULL, qx REAL NOT NULL, "              \
	"qy REAL NOT NULL, qz REAL NOT NULL, status TEXT NOT NULL"

static const struct {
	const char *name;
	int first, last; /* formats that have it so */
	const char *sql; /* NULL: as today's */
} tables[] = {
	{"meta", 1, 4, NULL},
	{"force", 1, 4,
	 "CREATE TABLE force(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "
	 "code INTEGER NOT NULL)"},
	{"tracker", 1, 1, TRACKER ")"},
	{"tracker", 2, 4, TRACKER ", station INTEGER NOT NULL, button INTEGER NOT NULL)"},
	{"depth", 1, 4,
	 "CREATE TABLE depth(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "
	 "depth_mm REAL NOT NULL, velocity_mm_s REAL NOT NULL)"},
	{"events", 1, 4, NULL},
	{"frames", 2, 3, FRAMES ")"},
	{"frames", 4, 4, FRAMES ", sha256 BLOB NOT NULL)"},
	{"streams", 2, 4, NULL},
	{"knots", 2, 4, NULL},
	{"ledger", 2, 4, NULL},
	{"wall", 3, 4,
	 "CREATE TABLE wall(seq INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "
	 "tai_ns INTEGER NOT NULL, uncertainty_ns REAL, rate_ppb REAL NOT NULL, "
	 "rate_uncertainty_ppb REAL NOT NULL, utc_offset_s INTEGER NOT NULL, "
	 "held INTEGER NOT NULL, source TEXT NOT NULL, reference TEXT NOT NULL, "
	 "leap TEXT NOT NULL, restart TEXT NOT NULL)"},
	{"seal", 4, 4, NULL},
};

#define TABLES (sizeof(tables) / sizeof(*tables))

static const char *sql_of(size_t table)
{
	int i = 0;

	if (tables[table].sql)
		return tables[table].sql;
	while (strcmp(incise_schema_tables[i].name, tables[table].name))
		i++;
	return incise_schema_tables[i].sql;
}

static int check_tables(struct incise_recording *rec, struct incise_error *err)
{
	struct incise_schema_table has[TABLES + 1];
	int n = 0;

	for (size_t i = 0; i < TABLES; i++)
		if (rec->form >= tables[i].first && rec->form <= tables[i].last)
			has[n++] =
				(struct incise_schema_table){tables[i].name, sql_of(i)};
	has[n] = (struct incise_schema_table){NULL, NULL};
	return incise_schema_check(rec->db, rec->path, has, err);
}

/* Columns as of format 4: station 0, which is unknown, no button, no digest. Returns an SQLite code. */
static int make_views(struct incise_recording *rec)
{
	int rc = SQLITE_OK;

	for (size_t i = 0; i < TABLES && rc == SQLITE_OK; i++) {
		char sql[700];

		if (tables[i].last < 4 || tables[i].first <= rec->form)
			continue;
		if (!strcmp(tables[i].name, "tracker"))
			snprintf(sql, sizeof(sql),
				 "CREATE TEMP VIEW tracker AS SELECT *, 0 AS station, 0 "
				 "AS button FROM main.tracker");
		else if (!strcmp(tables[i].name, "frames") && rec->form >= 2)
			snprintf(sql, sizeof(sql),
				 "CREATE TEMP VIEW frames AS SELECT *, zeroblob(32) AS "
				 "sha256 FROM main.frames");
		else
			snprintf(sql, sizeof(sql), "CREATE TEMP %s",
				 sql_of(i) + strlen("CREATE "));
		rc = sqlite3_exec(rec->db, sql, NULL, NULL, NULL);
	}
	if (rc == SQLITE_OK && rec->form >= 2)
		rc = sqlite3_exec(rec->db,
				  "CREATE TEMP VIEW ledger AS SELECT * FROM main.ledger "
				  "WHERE instr(stream, ':')",
				  NULL, NULL, NULL);
	return rc != SQLITE_OK
		       ? rc
		       : sqlite3_exec(rec->db,
				      rec->form < 2
					      ? "CREATE TEMP VIEW blocks AS SELECT *, "
						"NULL AS sha256, NULL AS data FROM "
						"temp.ledger"
					      : "CREATE TEMP VIEW blocks AS SELECT *, "
						"NULL AS sha256, NULL AS data FROM "
						"main.ledger WHERE NOT instr(stream, "
						"':')",
				      NULL, NULL, NULL);
}

/* --- rows ------------------------------------------------------------------------------ */

/* A value of the row at hand, into a column. False: its type is not that of the column. */
static bool take_value(sqlite3_stmt *stmt, int at, char type, union incise_column *column,
		       size_t row)
{
	const int found = sqlite3_column_type(stmt, at);
	const int bytes = found == SQLITE_TEXT || found == SQLITE_BLOB
				  ? sqlite3_column_bytes(stmt, at)
				  : 0;

	switch (type) {
	case 'i':
		column->i[row] = sqlite3_column_int64(stmt, at);
		return found == SQLITE_INTEGER;
	case 'c':
		column->c[row] = bytes ? *(const char *)sqlite3_column_text(stmt, at) : 0;
		return found == SQLITE_TEXT;
	case 's':
		memset(column->s[row], 0, sizeof(*column->s));
		if (found != SQLITE_TEXT || bytes > INCISE_LEDGER_TEXT)
			return false;
		memcpy(column->s[row], sqlite3_column_text(stmt, at), bytes);
		return true;
	case 'h':
		if (found != SQLITE_BLOB || bytes != sizeof(*column->h))
			return false;
		memcpy(column->h[row], sqlite3_column_blob(stmt, at), bytes);
		return true;
	default:
		column->r[row] =
			found == SQLITE_NULL ? NAN : sqlite3_column_double(stmt, at);
		return (found == SQLITE_FLOAT && isfinite(column->r[row])) ||
		       (found == SQLITE_NULL && type == 'n');
	}
}

static bool take_old_format_row(struct incise_source *source)
{
	struct incise_batch *batch = &source->batch;
	bool good = true;

	for (int i = 0; batch->form->types[i]; i++)
		good &= take_value(source->stmt, i, batch->form->types[i],
				   &batch->column[i], batch->n);
	return good;
}

/* An impossible row ends a batch, and is reported by the next call. */
static int next_rows(struct incise_source *source, struct incise_error *err)
{
	struct incise_batch *batch = &source->batch;
	int rc = SQLITE_ROW;

	batch->n = 0;
	if (!incise_batch_reserve(batch, source->rows_max))
		return incise_schema_no_memory(source->recording->path, err);
	while (batch->n < source->rows_max &&
	       (source->held || (rc = incise_source_step(source)) == SQLITE_ROW)) {
		source->held = false;
		if (take_old_format_row(source)) {
			batch->n++;
			continue;
		}
		source->held = batch->n > 0;
		if (source->held)
			return 1;
		return incise_error_set(err, EINVAL,
					"%s: damaged: table %s, row %lld is invalid; "
					"`sqlite3 %s/%s` shows it",
					source->recording->path, batch->form->table,
					(long long)sqlite3_column_int64(source->stmt, 0),
					source->recording->path, INCISE_SCHEMA_DB);
	}
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		return incise_schema_fail(source->recording->db, source->recording->path,
					  err);
	return batch->n > 0;
}

static int open_rows(struct incise_source *source, int64_t from_seq, bool from_end)
{
	const struct incise_ledger_form *form = source->batch.form;
	char sql[300];
	int rc;

	snprintf(sql, sizeof(sql), "SELECT %s FROM %s WHERE seq >= ? ORDER BY seq%s",
		 form->columns, form->table, from_end ? " DESC" : "");
	rc = sqlite3_prepare_v2(source->recording->db, sql, -1, &source->stmt, NULL);
	return rc == SQLITE_OK ? sqlite3_bind_int64(source->stmt, 1, from_seq) : rc;
}

static int64_t seek_row(struct incise_recording *recording, int stream, int64_t t_ns)
{
	return incise_schema_ask(recording->db, INT64_MIN,
				 "SELECT min(seq) FROM %s WHERE t_ns >= %lld",
				 incise_ledger_forms[stream].table, (long long)t_ns);
}

/* The last checksums of its ledger, which sum up everything. */
static char *find_identity(struct incise_recording *recording)
{
	sqlite3_stmt *stmt = NULL;
	char *text = NULL, *more;

	if (sqlite3_prepare_v2(
		    recording->db,
		    "SELECT stream, block, count, crc FROM main.ledger AS a WHERE "
		    "block = (SELECT max(block) FROM main.ledger AS b WHERE "
		    "b.stream = a.stream) ORDER BY stream",
		    -1, &stmt, NULL) != SQLITE_OK)
		return NULL;
	while (sqlite3_step(stmt) == SQLITE_ROW) {
		if (asprintf(&more, "%s%s%.40s:%lld:%lld:%08llx", text ? text : "",
			     text ? " " : "", (const char *)sqlite3_column_text(stmt, 0),
			     sqlite3_column_int64(stmt, 1), sqlite3_column_int64(stmt, 2),
			     (unsigned long long)sqlite3_column_int64(stmt, 3)) < 0)
			more = NULL;
		free(text);
		text = more;
		if (!text || strlen(text) > 4000)
			break;
	}
	sqlite3_finalize(stmt);
	return text;
}

static const struct incise_old rows = {open_rows, next_rows, seek_row, find_identity};

int incise_old_adopt(struct incise_recording *rec, bool any, struct incise_error *err)
{
	int rc;

	if (rec->form < 4 && !any)
		return incise_error_set(
			err, ENOTSUP,
			"%s: has format %d of an older incise; `incise "
			"recover %s -o NEW.rec` makes one of today's of it",
			rec->path, rec->form, rec->path);
	rc = check_tables(rec, err);
	if (!rc && make_views(rec) != SQLITE_OK)
		rc = incise_schema_fail(rec->db, rec->path, err);
	rec->old = &rows;
	return rc;
}

bool incise_old_is_sealed(const struct incise_recording *recording)
{
	return recording->form >= 4;
}
