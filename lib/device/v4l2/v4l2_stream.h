/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A camera's pictures, in memory that the driver fills and that is mapped here: nothing
 * is copied. A buffer is in one of five places:
 *
 *      driver ──dequeued──▶ thread ──whole──▶ waiting ──read──▶ held by the caller
 *        ▲                    │                  │                    │
 *        └──────queued────────┴── damaged,       │ no room: oldest    │ the next read
 *                                 late ◀─────────┘         returned ◀─┘
 *
 * One thread steps; another one reads, without a lock or a system call: it takes the
 * oldest that waits, and leaves the one it held before in a set that the thread queues
 * again. Three quarters of the buffers may wait (24 of 32), and all but 3 at most: one is
 * held, one returned, one the driver's. So what a caller holds is never written to, and
 * four buffers suffice that none is waited for.
 */
#ifndef INCISE_V4L2_STREAM_H
#define INCISE_V4L2_STREAM_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>
#include "v4l2_format.h"

#define V4L2_BUFFERS_MOST 32 /* bits of a set */

/* A mapped buffer, and the picture in it. */
struct v4l2_slot {
	void *data;
	size_t length;
	bool queued; /* the driver's */
	size_t size;
	int64_t t_ns;
	uint64_t seq;
};

struct v4l2_stream {
	int fd, n;
	const char *where;
	struct v4l2_shape shape;
	int64_t exposure_ns;
	bool runs;
	struct v4l2_slot slot[V4L2_BUFFERS_MOST];
	/* Between the two threads. */
	_Alignas(64) atomic_ullong tail; /* first that waits; both threads move it */
	atomic_ullong head;		 /* behind the last; the thread's */
	_Atomic signed char waiting[V4L2_BUFFERS_MOST];
	atomic_uint returned; /* a bit per slot */
	atomic_ullong lost, damaged;
	/* The reader's. */
	_Alignas(64) int held;
	/* The thread's. */
	_Alignas(64) bool any;
	uint32_t sequence; /* the driver's, of the last picture */
	uint64_t seq;	   /* ours */
	int64_t stamp_ns;  /* of the last whole one */
	int64_t seen_ns;   /* when the last one came */
	int errors, damaged_row;
};

/*
 * Map buffers and let the driver begin. 0; -EPROTO: it stamps pictures with another clock
 * than CLOCK_MONOTONIC, or has no buffers that can be; -EBUSY, -ENODEV, -EIO, -ENOMEM.
 * Whatever it returns, v4l2_stream_stop() is to be called. @where begins messages, and
 * must live as long.
 */
int v4l2_stream_start(struct v4l2_stream *stream, int fd, const struct v4l2_shape *shape,
		      int64_t exposure_ns, const char *where, struct incise_error *err);

/*
 * Wait for a picture for at most @timeout_ms, and take it from the driver. 1: one came,
 * whole or damaged; 0: none; -ENODEV, -EIO: the stream is at its end, @err says why.
 */
int v4l2_stream_step(struct v4l2_stream *stream, int timeout_ms,
		     struct incise_error *err);

/* The oldest picture that waits; 1 or 0. Real-time safe. */
int v4l2_stream_read(struct v4l2_stream *stream, struct incise_camera_frame *frame);

/* No thread may step or read any more. */
void v4l2_stream_stop(struct v4l2_stream *stream);

#endif
