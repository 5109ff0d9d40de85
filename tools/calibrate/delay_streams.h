/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Streams for incise calibrate delay, from a recording that is there or is made now.
 */
#ifndef INCISE_DELAY_STREAMS_H
#define INCISE_DELAY_STREAMS_H

#include <stdbool.h>
#include <incise/calibrate_delay.h>
#include <incise/calibration.h>
#include <incise/recording.h>

enum { DELAY_FORCE, DELAY_TRACKER, DELAY_CAMERA, DELAY_STREAMS };

struct delay_stream {
	struct incise_delay_point *points; /* force N, others depth mm */
	int n;				   /* 0: there is none */
	struct incise_stream about;
};

/* force, tracker, camera */
extern const char *const delay_stream_names[DELAY_STREAMS];

/* Read a recording. Fails the program. */
void delay_streams_read(struct delay_stream streams[DELAY_STREAMS], const char *path);

/*
 * Record a rig for some time into @path, which ends in .rec, with its camera where rig.conf
 * names one or @camera says so. Returns 0, or -1 with *err: then part of it may lie there.
 */
int delay_streams_record(const char *rig, const struct incise_calibration *calibration,
			 double time_s, bool camera, const char *path,
			 struct incise_error *err);

#endif
