// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The form of recording.db; see schema.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include "schema.h"

/*
 * The texts that SQLite keeps of the tables are compared when a recording is opened, so a view,
 * a virtual table or a generated column cannot replace one. Additional tables are ignored.
 */
const struct incise_schema_table incise_schema_tables[] = {
	{"meta", "CREATE TABLE meta(key TEXT PRIMARY KEY NOT NULL, value)"},
	{"events", "CREATE TABLE events(t_ns INTEGER NOT NULL, kind TEXT NOT NULL, "
		   "text TEXT NOT NULL)"},
	{"streams",
	 "CREATE TABLE streams(name TEXT PRIMARY KEY NOT NULL, device TEXT NOT NULL, "
	 "stamped INTEGER NOT NULL, nominal_hz REAL, delay_ns INTEGER NOT NULL, "
	 "delay_sd_ns INTEGER, grain_ns INTEGER NOT NULL, rows INTEGER NOT NULL, "
	 "lost INTEGER NOT NULL, late INTEGER NOT NULL, rate_hz REAL, drift_ppm REAL, "
	 "drift_sd_ppm REAL, jitter_ns REAL, jitter_max_ns REAL, offset_ns REAL, "
	 "offset_sd_ns REAL, ended TEXT)"},
	{"knots", "CREATE TABLE knots(stream TEXT NOT NULL, knot INTEGER NOT NULL, "
		  "seq INTEGER NOT NULL, t_ns INTEGER NOT NULL, sd_ns REAL NOT NULL, "
		  "begins INTEGER NOT NULL, PRIMARY KEY(stream, knot)) WITHOUT ROWID"},
	{"ledger", "CREATE TABLE ledger(stream TEXT NOT NULL, block INTEGER NOT NULL, "
		   "first_seq INTEGER NOT NULL, last_seq INTEGER NOT NULL, "
		   "first_ns INTEGER NOT NULL, last_ns INTEGER NOT NULL, "
		   "count INTEGER NOT NULL, lost INTEGER NOT NULL, crc INTEGER NOT NULL, "
		   "PRIMARY KEY(stream, block)) WITHOUT ROWID"},
	{"blocks",
	 "CREATE TABLE blocks(stream TEXT NOT NULL, block INTEGER NOT NULL, "
	 "first_seq INTEGER NOT NULL, last_seq INTEGER NOT NULL, "
	 "first_ns INTEGER NOT NULL, last_ns INTEGER NOT NULL, "
	 "count INTEGER NOT NULL, lost INTEGER NOT NULL, crc INTEGER NOT NULL, "
	 "sha256 BLOB NOT NULL, data BLOB NOT NULL, PRIMARY KEY(stream, block))"},
	{"seal",
	 "CREATE TABLE seal(number INTEGER PRIMARY KEY, t_ns INTEGER NOT NULL, "
	 "force INTEGER NOT NULL, tracker INTEGER NOT NULL, camera INTEGER NOT NULL, "
	 "wall INTEGER NOT NULL, head BLOB NOT NULL)"},
	{NULL, NULL},
};

#define TEXT_OF(x) TEXT_OF_(x)
#define TEXT_OF_(x) #x

int incise_schema_create(sqlite3 *db)
{
	int rc = sqlite3_exec(
		db,
		"PRAGMA application_id=" TEXT_OF(
			INCISE_SCHEMA_APPLICATION) ";"
						   "PRAGMA user_version=" TEXT_OF(
							   INCISE_SCHEMA_VERSION) ";",
		NULL, NULL, NULL);

	for (int i = 0; incise_schema_tables[i].name && rc == SQLITE_OK; i++)
		rc = sqlite3_exec(db, incise_schema_tables[i].sql, NULL, NULL, NULL);
	return rc;
}

int incise_schema_errno(sqlite3 *db)
{
	int cause =
		errno; /* SQLite's own sqlite3_system_errno() is 0 after a failed COMMIT */

	switch (db ? sqlite3_errcode(db) & 0xff : SQLITE_NOMEM) {
	case SQLITE_FULL:
		return ENOSPC;
	case SQLITE_NOMEM:
		return ENOMEM;
	case SQLITE_IOERR:
		/* SQLite knows only ENOSPC; a quota and a limit on the size of files are
		 * full disks for the user too. */
		return cause == EDQUOT || cause == EFBIG || cause == ENOSPC ? ENOSPC
									    : EIO;
	case SQLITE_CANTOPEN:
	case SQLITE_PERM:
	case SQLITE_READONLY:
	case SQLITE_AUTH:
		cause = sqlite3_system_errno(db);
		return cause ? cause : EACCES;
	case SQLITE_BUSY:
	case SQLITE_LOCKED:
		return EBUSY;
	case SQLITE_CORRUPT:
	case SQLITE_NOTADB:
	case SQLITE_ERROR: /* a table or column that is not there */
	case SQLITE_FORMAT:
	case SQLITE_SCHEMA:
	case SQLITE_CONSTRAINT:
	case SQLITE_MISMATCH:
	case SQLITE_TOOBIG:
		return EINVAL;
	default:
		return EIO;
	}
}

int incise_schema_fail(sqlite3 *db, const char *path, struct incise_error *err)
{
	int code = incise_schema_errno(db);

	if (code == EINVAL)
		return incise_error_set(
			err, code,
			"%s: damaged (%s); copy it; `sqlite3 %s/%s .recover` may save "
			"rows",
			path, sqlite3_errmsg(db), path, INCISE_SCHEMA_DB);
	return incise_error_set(err, code, "%s: cannot be read: %s", path,
				db ? sqlite3_errmsg(db) : strerror(ENOMEM));
}

int incise_schema_no_memory(const char *path, struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "%s: out of memory", path);
}

/* The number that a statement returns. */
static int pragma(sqlite3 *db, const char *sql, sqlite3_int64 *value)
{
	sqlite3_stmt *stmt;
	int rc = sqlite3_prepare_v2(db, sql, -1, &stmt, NULL);

	if (rc != SQLITE_OK)
		return rc;
	*value = sqlite3_step(stmt) == SQLITE_ROW ? sqlite3_column_int64(stmt, 0) : 0;
	return sqlite3_finalize(stmt); /* reports a failed step too */
}

int incise_schema_run(sqlite3_stmt *stmt)
{
	sqlite3_step(stmt);
	return sqlite3_reset(stmt);
}

int64_t incise_schema_ask(sqlite3 *db, int64_t otherwise, const char *format, ...)
{
	sqlite3_stmt *stmt = NULL;
	va_list args;
	char *sql;

	va_start(args, format);
	sql = sqlite3_vmprintf(format, args);
	va_end(args);
	if (sql && sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_INTEGER)
		otherwise = sqlite3_column_int64(stmt, 0);
	sqlite3_finalize(stmt);
	sqlite3_free(sql);
	return otherwise;
}

bool incise_schema_is_joined(sqlite3 *db)
{
	return incise_schema_ask(db, 0, "PRAGMA application_id") == INCISE_SCHEMA_JOINED;
}

int incise_schema_check(sqlite3 *db, const char *path,
			const struct incise_schema_table *tables,
			struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int rc = 0;

	if (sqlite3_prepare_v2(
		    db, "SELECT sql FROM sqlite_master WHERE name = ? AND type = 'table'",
		    -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(db, path, err);
	for (int i = 0; tables[i].name && !rc; i++) {
		const char *sql;
		int step;

		sqlite3_reset(stmt);
		sqlite3_bind_text(stmt, 1, tables[i].name, -1, SQLITE_STATIC);
		step = sqlite3_step(stmt);
		sql = step == SQLITE_ROW ? (const char *)sqlite3_column_text(stmt, 0)
					 : NULL;
		if (step != SQLITE_ROW && step != SQLITE_DONE)
			rc = incise_schema_fail(db, path, err);
		else if (!sql || strcmp(sql, tables[i].sql))
			rc = incise_error_set(
				err, EINVAL, "%s: damaged or altered: table '%s' is %s",
				path, tables[i].name,
				sql ? "not as incise creates it" : "missing");
	}
	sqlite3_finalize(stmt);
	return rc;
}

int incise_schema_form(sqlite3 *db, const char *path, int *form, struct incise_error *err)
{
	sqlite3_int64 application, version, entries;

	if (pragma(db, "PRAGMA application_id", &application) != SQLITE_OK ||
	    pragma(db, "PRAGMA user_version", &version) != SQLITE_OK ||
	    pragma(db, "SELECT count(*) FROM sqlite_master", &entries) != SQLITE_OK)
		return incise_schema_fail(db, path, err);
	if (!application && !version && !entries)
		return incise_error_set(err, EINVAL,
					"%s: empty: interrupted before the first data",
					path);
	if (application != INCISE_SCHEMA_APPLICATION)
		return incise_error_set(err, EINVAL,
					"%s: not a recording: its %s was not made by "
					"incise",
					path, INCISE_SCHEMA_DB);
	if (version > INCISE_SCHEMA_VERSION)
		return incise_error_set(
			err, EINVAL,
			"%s: made by a newer incise (format %lld, this version reads "
			"up to %d); use that version",
			path, (long long)version, INCISE_SCHEMA_VERSION);
	if (version < 1)
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: its format has the invalid number %lld", path,
			(long long)version);
	*form = version;
	return 0;
}
