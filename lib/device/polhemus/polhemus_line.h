/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The line to a tracker: USB, serial, or simulated by a test. For one thread at a time.
 */
#ifndef INCISE_POLHEMUS_LINE_H
#define INCISE_POLHEMUS_LINE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#define POLHEMUS_LINE_CHUNK 1024 /* bytes of a read; a packet of USB 2 */

struct polhemus_line;

struct polhemus_line_ops {
	/* 0: all was written within a second; -ENODEV (gone), -EIO. */
	int (*write)(struct polhemus_line *line, const void *bytes, size_t n);
	/*
	 * Returns the number of bytes that came, and the time of the last one
	 * (CLOCK_MONOTONIC). 0: no bytes within @timeout_ms; -ENODEV: gone, which reopen()
	 * may mend; -EIO.
	 */
	ssize_t (*read)(struct polhemus_line *line, void *bytes, size_t size,
			int64_t *t_ns, int timeout_ms);
	/* Try to open it again. 0, or -ENODEV, … */
	int (*reopen)(struct polhemus_line *line);
	void (*close)(struct polhemus_line *line);
};

struct polhemus_line {
	const struct polhemus_line_ops *ops;
	int family;	     /* enum polhemus_family; -1: not known */
	int64_t ns_per_byte; /* of a serial line, else 0 */
	int64_t grain_ns;    /* grid of arrival times: frames of USB; else 0 */
	char name[40];	     /* for messages: "/dev/ttyUSB0" */
	/* A dialogue is cancelled once this is true; NULL: never. */
	const _Atomic bool *stop;
};

#endif
