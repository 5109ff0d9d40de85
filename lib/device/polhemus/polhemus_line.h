/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The way to a tracker: USB, a serial line, or a test's own. One thread at a time uses it.
 */
#ifndef INCISE_POLHEMUS_LINE_H
#define INCISE_POLHEMUS_LINE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#define POLHEMUS_LINE_CHUNK 1024 /* bytes that a reader has room for; a packet of USB 2 */

struct polhemus_line;

struct polhemus_line_ops {
	/* All of it within a second, or -ENODEV (gone), -EIO. */
	int (*write)(struct polhemus_line *line, const void *bytes, size_t n);
	/*
	 * What came, at most @size, and when its last byte did (CLOCK_MONOTONIC). 0: nothing
	 * within @timeout_ms. -ENODEV: gone, which reopen() may mend; -EIO.
	 */
	ssize_t (*read)(struct polhemus_line *line, void *bytes, size_t size,
			int64_t *t_ns, int timeout_ms);
	/* Try to get back what is gone, or what fell silent. 0, or not there: -ENODEV, … */
	int (*reopen)(struct polhemus_line *line);
	void (*close)(struct polhemus_line *line);
};

struct polhemus_line {
	const struct polhemus_line_ops *ops;
	int family;	     /* enum polhemus_family, or -1: to be asked */
	int64_t ns_per_byte; /* of a serial line, else 0 */
	int64_t grain_ns;    /* arrivals come on a grid: frames of USB; else 0 */
	char name[40];	     /* for messages: "/dev/ttyUSB0" */
	/* A dialogue is given up once this is true; NULL: never. */
	const _Atomic bool *stop;
};

#endif
