/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From bytes of the device to samples in a ring:
 *
 *   bytes -> polhemus_records -> polhemus_gaps -> tip, mm -> ring -> who reads
 *
 * No thread, no clock, no system call: the tests drive it in a time of their own.
 */
#ifndef INCISE_POLHEMUS_STREAM_H
#define INCISE_POLHEMUS_STREAM_H

#include <stdatomic.h>
#include <incise/tracker.h>
#include "../../base/ring.h"
#include "polhemus_gaps.h"
#include "polhemus_records.h"

#define POLHEMUS_RING_S 4 /* of samples, at 240 Hz of four stations */

struct polhemus_stream {
	struct incise_tracker_setup setup;
	struct polhemus_records records;
	struct polhemus_gaps gaps;
	struct incise_ring ring; /* of struct incise_tracker_sample */
	uint64_t no_room;	 /* seq that the ring had no place for count as lost */
	bool anew;		 /* the next sample is to say that it begins */
	_Atomic uint64_t lost;
};

/* 0, -ENOMEM. @setup is copied. */
int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout);
/* The device was told to send, at @t_ns: from there on what is missing is lost. */
void polhemus_stream_start(struct polhemus_stream *stream, int64_t t_ns);
void polhemus_stream_free(struct polhemus_stream *stream);

/* The link was gone, and the device was set up anew, so that records look as @layout says. */
void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout);

/* Nothing has come up to @t_ns: what is missing counts as lost, until something comes. */
void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns);

/* Any number of bytes that came at @t_ns: how many records were in them. One thread. */
int polhemus_stream_put(struct polhemus_stream *stream, const unsigned char *bytes,
			size_t n, int64_t t_ns);

/* One other thread; real-time safe. */
int polhemus_stream_take(struct polhemus_stream *stream,
			 struct incise_tracker_sample *samples, int n) INCISE_REALTIME;
uint64_t polhemus_stream_lost(const struct polhemus_stream *stream);

#endif
