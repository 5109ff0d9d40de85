/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Output files that appear under their name only when they are complete. A file is written
 * without a name (O_TMPFILE), or with a hidden temporary name if the file system does not
 * support that, and gets its name by rename(2) after fsync(2). A killed process leaves nothing
 * under the final name, or the previous file unchanged.
 */
#ifndef INCISE_OUTFILE_H
#define INCISE_OUTFILE_H

#include <stdio.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_outfile;

/**
 * Open a file for writing. "-" is standard output; an existing path that is not a regular file
 * (a pipe, /dev/null) is written directly; a symbolic link is followed. A replaced file keeps
 * its mode, and its owner and group as far as this process may set them.
 *
 * @return file, to be ended with incise_outfile_commit() or incise_outfile_abort(); NULL
 *         with errno of open(2), fchmod(2), ENOMEM, EISDIR.
 */
INCISE_API struct incise_outfile *incise_outfile_open(const char *path,
						      struct incise_error *err);

/** The stream to write to; owned by the outfile, not to be closed. */
INCISE_API FILE *incise_outfile_stream(struct incise_outfile *file);

/**
 * Flush, sync and name the file; frees @file in any case.
 *
 * @return 0, or a negative errno of write(2), fsync(2), rename(2): ENOSPC, EIO, …; then the
 *         final name is unchanged.
 */
INCISE_API int incise_outfile_commit(struct incise_outfile *file,
				     struct incise_error *err);

/** Discard the written data and free @file. */
INCISE_API void incise_outfile_abort(struct incise_outfile *file);

INCISE_END_DECLS
#endif
