/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Start of a recording by something outside of the rig: a time, or a pulse of the SYNC line of the
 * stepper module.
 */
#ifndef INCISE_CAPTURE_START_H
#define INCISE_CAPTURE_START_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/recorder.h>

struct start_time {
	bool given, tai; /* of TAI, else of UTC */
	int64_t ns;	 /* since 1970 */
};

/* Of --start-at; fails the program. */
void start_time_parse(struct start_time *start, const char *text);

/*
 * Nanoseconds until the start by the recorder's wall time at @now_ns of the rig's clock; INT64_MAX
 * while there is none.
 */
int64_t start_time_left(const struct start_time *start,
			const struct incise_recorder *recorder, int64_t now_ns);

/* A pulse of the SYNC line. */
struct start_pulse {
	int64_t t_ns; /* of its edge, CLOCK_MONOTONIC */
	int64_t number;
};

/*
 * Open the events of a controller, /dev/incise-stepper0; a named pipe of such events serves for
 * tests. Returns a file descriptor; fails the program.
 */
int start_sync_open(const char *path);

/* The next pulse; does not wait. False: none. @lost: the device is gone. */
bool start_sync_next(int fd, struct start_pulse *pulse, bool *lost);

#endif
