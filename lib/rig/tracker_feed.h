/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A tracker whose samples a thread puts into a ring:
 *
 *     device ─▶ thread: a driver ─▶ ring ─▶ incise_tracker_read(), real-time safe
 *                         └─▶ the end, with its cause
 */
#ifndef INCISE_DEVICE_TRACKER_FEED_H
#define INCISE_DEVICE_TRACKER_FEED_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/backend.h>
#include <incise/error.h>
#include "../base/ring.h"

/* The first member of a driver's tracker. */
struct tracker_feed {
	struct incise_tracker tracker;
	struct incise_ring *ring; /* of struct incise_tracker_sample */
	_Atomic int gone;	  /* negative errno, for good: then cause is set */
	struct incise_error cause;
};

/* As read and cause of struct incise_tracker_ops. */
int tracker_feed_read(struct incise_tracker *tracker,
		      struct incise_tracker_sample *samples, int n) INCISE_REALTIME;
int tracker_feed_cause(struct incise_tracker *tracker, char *text, size_t size);

/* The driver's thread ends; the reason for people. Readers get -ENODEV behind the last sample. */
void tracker_feed_end(struct tracker_feed *feed, const char *fmt, ...)
	INCISE_PRINTF(2, 3);

#define TRACKER_REPEAT_MAX 12

/* A pose as a device sent it, and since when it sends the same. Zeros: no samples yet. */
struct tracker_repeat {
	double pose[TRACKER_REPEAT_MAX];
	int64_t since_ns;
	bool started;
};

/*
 * Whether a device sends the same pose for longer than @most_ms; 0: never. Every sensor has
 * noise, so a pose that stays the same to its last digit is not measured.
 */
bool tracker_repeats(struct tracker_repeat *repeat, const double *pose, size_t n,
		     int64_t t_ns, double most_ms);

#endif
