/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Opening the database of a recording for reading. It is untrusted, and nothing is ever written, made or
 * removed where it is: what SQLite has to write before it can read is read from a private copy, which has
 * no name once it is open.
 *
 *     closed                                    ──▶ in place, read-only
 *     a recorder has it                         ──▶ a copy with its log, of any size
 *     a log (-wal), a journal, or a form that
 *     needs one: its recorder was interrupted   ──▶ a copy with that, up to INCISE_DATABASE_COPY_MAX
 */
#ifndef INCISE_RECORDING_DATABASE_H
#define INCISE_RECORDING_DATABASE_H

#include <stdbool.h>
#include <sqlite3.h>
#include <incise/error.h>

/* Bytes of an interrupted recording's database that are copied for reading. */
#define INCISE_DATABASE_COPY_MAX (1LL << 30)

/* The folder of a recording, path or path.part; to be freed; NULL with ENOENT, ENOMEM. */
char *incise_recording_folder(const char *path, struct incise_error *err);

/* Whether a recorder holds the lock of the folder. */
bool incise_recording_is_written(const char *folder);

/*
 * The database in the folder @path. 0; -errno with a line: EINVAL (no recording, or one with files that
 * none has), EFBIG (larger than what is copied), EBUSY, and those of the file and of the copy. *db is to
 * be closed in any case.
 */
int incise_database_open(const char *path, sqlite3 **db, struct incise_error *err);

/*
 * Make @file, which must not exist, of the database in the folder @path: whole and closed, with what its log
 * has, or without what its journal takes back. 0, or -errno with a line.
 */
int incise_database_recover(const char *path, const char *file, struct incise_error *err);

/* Copy the rest of a file. 0 or -errno. */
int incise_database_copy(int in, int out);

/* Remove a folder that failed, with all that is in it. */
void incise_database_remove(const char *folder);

/* Copy a regular file, not by a link, to @to. 0 or -errno; EINVAL: it is none. */
int incise_database_bring(const char *from, const char *to);

#endif
