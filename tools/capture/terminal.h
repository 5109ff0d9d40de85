/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The terminal of a running capture: a view of the streams, and single keys. It must never
 * hold up the recording.
 */
#ifndef INCISE_CAPTURE_TERMINAL_H
#define INCISE_CAPTURE_TERMINAL_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/recorder.h>
#include "trace.h"

struct capture_view {
	double planned_s;    /* 0: not known */
	double full_scale_N; /* of the force channel, for its level */
	bool depth;	     /* vision measures the depth */
	bool live;     /* its clock is real: in a pipe there is a line each second */
	char last[80]; /* the last marker */
	int64_t shown_ns, read_ns, line_ns;
	struct trace force_N, depth_mm;
};

/*
 * On a terminal draw at most ten times a second: traces of the last seconds, and the streams.
 * Otherwise print a line each second on stderr. @seconds: since the recording, or waiting,
 * started.
 */
void capture_view_show(struct capture_view *view, const struct incise_recorder *recorder,
		       double seconds);

/* From begin to end no write to the terminal waits for it. */
void capture_view_begin(struct capture_view *view);
void capture_view_end(void);

/*
 * From here on keys come at once and are not shown. At exit, while the program is suspended
 * (Ctrl-Z) and in the background the terminal is as before.
 */
void keyboard_begin(void);

/* Restore the terminal. */
void keyboard_end(void);

/* Whether another program had the terminal meanwhile; true once. */
bool keyboard_resumed(void);

/*
 * The next key, or 0; does not wait. There are none if standard input is no terminal or the
 * program is in the background.
 */
int keyboard_next(void);

#endif
