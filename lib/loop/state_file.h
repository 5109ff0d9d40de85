/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The file of a state page: how it comes to its name, and who lives.
 *
 *   made without a name ── filled, locked ── put under its name ── kept open and locked
 *
 * The lock is for writing, and of the open file (F_OFD_SETLK): it goes away with the process,
 * takes the right to write, and one can ask for it without taking it. A flock(2), which
 * anybody who may read can hold, would let any user keep a loop from starting.
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
	void *page;
	size_t size;
};

/*
 * A new file of zeros for a path, mapped and locked, with all its memory there. Returns 0;
 * -EBUSY (the writer of what is there lives), -EEXIST (what is there is no page), errno of
 * open(2), fallocate(2), mmap(2).
 */
int incise_state_file_new(struct incise_state_file *file, const char *path, size_t size,
			  struct incise_error *err);

/*
 * Put it under its name. Of two that do so at once only one gets there. Returns 0; -EBUSY,
 * errno of linkat(2), rename(2).
 */
int incise_state_file_publish(struct incise_state_file *file, struct incise_error *err);

/* Let go of it; what has its name keeps it. */
void incise_state_file_close(struct incise_state_file *file);

/* Whether somebody holds the lock of an open file. Returns 1, 0 or -errno. */
int incise_state_file_held(int fd);

#endif
