/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A file that appears under its name only when it is whole. It is written without a name
 * (O_TMPFILE) or, where the file system cannot do that, under a hidden temporary one,
 * and takes its place by rename(2) after fsync(2). A killed process leaves nothing under
 * the final name and an older file there untouched.
 */
#ifndef INCISE_OUTFILE_H
#define INCISE_OUTFILE_H

#include <stdio.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_outfile;

/**
 * Open a file for writing. "-" is standard output; a path that exists and is not a
 * regular file (a pipe, /dev/null) is written directly; a symbolic link is followed. A file
 * that is replaced keeps its mode, and its owner and group as far as this process may.
 *
 * @return file, to be ended with incise_outfile_commit() or incise_outfile_abort(); NULL
 *         with errno of open(2), fchmod(2), ENOMEM, EISDIR.
 */
INCISE_API struct incise_outfile *incise_outfile_open(const char *path,
						      struct incise_error *err);

/** The stream to write to; owned by the outfile, not to be closed. */
INCISE_API FILE *incise_outfile_stream(struct incise_outfile *file);

/**
 * Flush, sync and put the file under its name; frees @file in any case.
 *
 * @return 0, or a negative errno of write(2), fsync(2), rename(2): ENOSPC, EIO, …; then
 *         nothing has changed under the final name.
 */
INCISE_API int incise_outfile_commit(struct incise_outfile *file,
				     struct incise_error *err);

/** Forget what was written and free @file. */
INCISE_API void incise_outfile_abort(struct incise_outfile *file);

INCISE_END_DECLS
#endif
