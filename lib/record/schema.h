/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The form of recording.db: its tables, its identification, and messages for SQLite's errors.
 * Described for users in incise-recording(5).
 */
#ifndef INCISE_SCHEMA_H
#define INCISE_SCHEMA_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include <incise/error.h>

#define INCISE_SCHEMA_DB "recording.db"	     /* inside the folder NAME.rec */
#define INCISE_SCHEMA_APPLICATION 0x494e4349 /* "INCI", SQLite's application_id */
#define INCISE_SCHEMA_VERSION 5		     /* SQLite's user_version */
#define INCISE_SCHEMA_JOINED 0x494e4353	     /* "INCS", of a joined recording */

/* Make the tables in an empty database. Returns an SQLite code. */
int incise_schema_create(sqlite3 *db);

/* Find the format of an opened database, 1 to INCISE_SCHEMA_VERSION. Returns 0, -EINVAL, or as incise_schema_fail(). */
int incise_schema_form(sqlite3 *db, const char *path, int *form,
		       struct incise_error *err);

struct incise_schema_table {
	const char *name, *sql;
};

/* Tables of today's format; the last has no name. */
extern const struct incise_schema_table incise_schema_tables[];

/* Check that it has these tables. Returns as incise_schema_form(). */
int incise_schema_check(sqlite3 *db, const char *path,
			const struct incise_schema_table *tables,
			struct incise_error *err);

/* Whether an opened database is that of a joined recording; see read/session.h. */
bool incise_schema_is_joined(sqlite3 *db);

/* Run a bound statement, to be bound anew. Returns an SQLite code. */
int incise_schema_run(sqlite3_stmt *stmt);

/* One integer by SQL, as of sqlite3_mprintf(); @otherwise if it is none, or cannot be read. */
int64_t incise_schema_ask(sqlite3 *db, int64_t otherwise, const char *format, ...);

/* The errno of the last SQLite error: EINVAL for a damaged file. */
int incise_schema_errno(sqlite3 *db);

/* Report a failed read of a recording; @path names it. Returns -errno. */
int incise_schema_fail(sqlite3 *db, const char *path, struct incise_error *err);

/* Returns -ENOMEM. */
int incise_schema_no_memory(const char *path, struct incise_error *err);

#endif
