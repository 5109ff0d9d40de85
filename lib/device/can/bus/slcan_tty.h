/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The serial line to an adapter that speaks slcan: ours alone, bytes as they are, lines that
 * go out whole or not at all. What they say is in slcan_line.h.
 */
#ifndef INCISE_SLCAN_TTY_H
#define INCISE_SLCAN_TTY_H

#include <stddef.h>
#include <sys/types.h>
#include <incise/error.h>
#include "slcan_line.h"

/* A frame, and a question behind it; as much as is put at once. */
#define SLCAN_TTY_PUT_MAX (SLCAN_LINE_MAX + 2)

struct slcan_tty {
	int fd;
	int gone; /* -ENODEV, -EIO: for good */

	/* What is left of what was written in part: out_n of 0 is nothing. */
	char out[SLCAN_TTY_PUT_MAX];
	unsigned int out_at, out_n;
};

/* 0; -ENODEV, -EACCES, -EBUSY, -EINVAL (no serial line), -EIO, and @where begins the line. */
int slcan_tty_open(struct slcan_tty *tty, const char *path, const char *where,
		   struct incise_error *err);

/* All of @n bytes, now or later; -ENOBUFS: none of them. -ENODEV, -EIO. */
int slcan_tty_put(struct slcan_tty *tty, const char *text, unsigned int n);

/* Go on with what is left. 0, -ENOBUFS (there is still some), -ENODEV, -EIO. */
int slcan_tty_flush(struct slcan_tty *tty);

/* How many bytes came; 0: none yet. -ENODEV, -EIO. */
ssize_t slcan_tty_read(struct slcan_tty *tty, void *bytes, size_t size);

/* @last goes out before the line does, where the adapter takes it within 100 ms. */
void slcan_tty_close(struct slcan_tty *tty, const char *last, unsigned int n);

#endif
