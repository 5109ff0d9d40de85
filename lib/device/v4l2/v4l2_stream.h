/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A camera's frames, in memory that the driver fills and that is mapped here, without a
 * copy. A buffer is in one of five places:
 *
 *      driver ──dequeued──▶ thread ──whole──▶ waiting ──read──▶ held by the caller
 *        ▲                    │                  │                    │
 *        └──────queued────────┴── damaged,       │ full: oldest       │ the next read
 *                                 late ◀─────────┘         returned ◀─┘
 *
 * One thread steps; another one reads, without a lock or a system call: it takes the
 * oldest waiting buffer, and returns the one it held before in a set that the thread
 * queues again. Three quarters of the buffers may wait (24 of 32), and all but 3 at most:
 * one is held, one returned, one the driver's. So a held buffer is never written to, and
 * with four buffers neither side waits.
 */
#ifndef INCISE_V4L2_STREAM_H
#define INCISE_V4L2_STREAM_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>
#include "v4l2_format.h"

#define V4L2_BUFFERS_MAX 32 /* bits of a set */

/* A mapped buffer, and the frame in it. */
struct v4l2_slot {
	void *data;
	size_t length;
	bool queued; /* owned by the driver */
	size_t size;
	int64_t t_ns;
	uint64_t seq;
};

/*
 * The clock of the timestamps. A frame arrives later than its timestamp, by its age, and timestamps
 * lie on a grid. Camera and thread may be late; a timestamp that is off the grid by more than half
 * a period, and by as much nearer to the arrival or farther from it, is wrong, unless the next two
 * follow it: then the clock was stepped.
 *
 *     grid          |       |       |       |       |       |
 *     timestamps    |       |  |        x   |       |       |          x is wrong
 *     arrivals         |       |  |        |   |       |       |
 */
struct v4l2_clock {
	double period_ns;	 /* 0: not known */
	double grid_ns, age_ns;	 /* of the last frame, without lateness */
	uint64_t seq, odd_seq;	 /* of the last frame, of the last one off the grid */
	int64_t odd_ns, last_ns; /* its timestamp; age of the last frame of any kind */
	int odd_row;
	/* The present window: its frames, the first one, the least age. */
	int n;
	uint64_t first_seq;
	int64_t first_ns, least_ns;
	/* The least ages of all windows. */
	int64_t lowest_ns, highest_ns;
};

struct v4l2_stream {
	int fd, n;
	const char *where;
	struct v4l2_shape shape;
	int64_t exposure_ns;
	bool runs;
	struct v4l2_slot slot[V4L2_BUFFERS_MAX];
	/* Shared by the two threads. */
	_Alignas(64) atomic_ullong tail; /* first waiting; moved by both threads */
	atomic_ullong head;		 /* behind the last; moved by the thread */
	_Atomic signed char waiting[V4L2_BUFFERS_MAX];
	atomic_uint returned; /* a bit per slot */
	atomic_ullong lost, damaged;
	atomic_llong clock_ns; /* see struct incise_camera_info */
	atomic_uint stride;    /* of the driver's count, from frame to frame */
	/* The reader's. */
	_Alignas(64) int held;
	/* The thread's. */
	_Alignas(64) bool any;
	uint32_t sequence;    /* of the driver, of the last frame */
	uint64_t seq;	      /* ours */
	int64_t timestamp_ns; /* of the last whole one */
	int64_t seen_ns;      /* when the last one came */
	int errors, damaged_row;
	int wrong_row; /* of these, whole but for the timestamp */
	struct v4l2_clock clock;
};

/*
 * Map buffers and start the driver. 0; -EPROTO: its timestamps are not of
 * CLOCK_MONOTONIC, or its buffers are impossible; -EBUSY, -ENODEV, -EIO, -ENOMEM.
 * v4l2_stream_stop() is due in any case. @where starts messages, and must live as long as
 * the stream.
 */
int v4l2_stream_start(struct v4l2_stream *stream, int fd, const struct v4l2_shape *shape,
		      int64_t exposure_ns, const char *where, struct incise_error *err);

/*
 * Wait for a frame for at most @timeout_ms and dequeue it. 1: a frame came, whole or
 * damaged; 0: no frame; -ENODEV, -EIO: the stream has ended, with the cause in @err.
 */
int v4l2_stream_step(struct v4l2_stream *stream, int timeout_ms,
		     struct incise_error *err);

/* The oldest waiting frame; 1 or 0. Real-time safe. */
int v4l2_stream_read(struct v4l2_stream *stream, struct incise_camera_frame *frame);

/* No thread may step or read after it. */
void v4l2_stream_stop(struct v4l2_stream *stream);

#endif
