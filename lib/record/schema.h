/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The form of recording.db: its tables, its identification, and messages for SQLite's errors.
 * Described for users in incise-recording(5).
 */
#ifndef INCISE_SCHEMA_H
#define INCISE_SCHEMA_H

#include <stdbool.h>
#include <sqlite3.h>
#include <incise/error.h>

#define INCISE_SCHEMA_DB "recording.db"	     /* inside the folder NAME.rec */
#define INCISE_SCHEMA_APPLICATION 0x494e4349 /* "INCI", SQLite's application_id */
#define INCISE_SCHEMA_VERSION 5		     /* SQLite's user_version */
#define INCISE_SCHEMA_JOINED 0x494e4353	     /* "INCS", of a joined recording */

/* Make the tables in an empty database. Returns an SQLite code. */
int incise_schema_create(sqlite3 *db);

/*
 * Check that an opened database is a recording of this or an older version with the tables of
 * this library, and find its form. Form 1 has no ledger, streams and frames, and no station and
 * button of the tracker; forms 1 and 2 have no wall time; forms 1 to 3 have no seal, and no digest
 * of a frame; forms 1 to 4 have a row a sample, form 5 blocks of them, and no depth. Returns 0, -EINVAL, or as incise_schema_fail().
 */
int incise_schema_check(sqlite3 *db, const char *path, int *form,
			struct incise_error *err);

/* Whether an opened database is that of a joined recording; see read/session.h. */
bool incise_schema_is_joined(sqlite3 *db);

/* The errno of the last SQLite error: EINVAL for a damaged file. */
int incise_schema_errno(sqlite3 *db);

/* Report a failed read of a recording; @path names it. Returns -errno. */
int incise_schema_fail(sqlite3 *db, const char *path, struct incise_error *err);

#endif
