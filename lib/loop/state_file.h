/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The file of a state page: its creation under its name, and the lock of its writer.
 *
 *   made without a name ── locked, written ── put under its name ── kept open and locked
 *
 * It is written by pwrite(2) and never mapped: others may cut it off, and then SIGBUS ends a
 * program that touches a mapping of it.
 *
 * The lock is a write lock of the open file (F_OFD_SETLK): it ends with the process, needs the
 * right to write, and can be queried without being taken. With a flock(2), which needs only the
 * right to read, any user could keep a loop from starting.
 */
#ifndef INCISE_STATE_FILE_H
#define INCISE_STATE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/error.h>

struct incise_state_file {
	char *path;
	char *hidden; /* ".NAME.123456" beside it, or NULL where the file has no name yet */
	int fd;
};

/*
 * A new file of zeros for a path, locked. Returns 0; -EBUSY (the page at the path has a living
 * writer), -EEXIST (another file is there), errno of open(2), fallocate(2).
 */
int incise_state_file_new(struct incise_state_file *file, const char *path, size_t size,
			  struct incise_error *err);

/*
 * Put it under its name. If two callers do so at once, only one succeeds. Returns 0; -EBUSY,
 * errno of linkat(2), rename(2).
 */
int incise_state_file_publish(struct incise_state_file *file, struct incise_error *err);

/* Write bytes at an offset. Returns 0 or a negative errno. */
int incise_state_file_write(const struct incise_state_file *file, size_t offset,
			    const void *from, size_t size);

/* Whether an open file is shorter than this. */
bool incise_state_file_short(int fd, size_t size);

/* Close it; a published file stays. */
void incise_state_file_close(struct incise_state_file *file);

/* Whether a writer holds the lock of an open file. Returns 1, 0 or -errno. */
int incise_state_file_held(int fd);

#endif
