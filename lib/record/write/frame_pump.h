/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From a camera to its file, so that nobody waits for a disk: not the camera, and not the
 * thread that records all the rest.
 *
 *     camera thread:  read ──copy──► slots, 2.5 s ──► file thread: put() ──► records ┐
 *                       └────copy──► slots, 8 ────► vision thread ───────► results ┴─► take()
 *
 * A picture for which there is no room is dropped, and counted; the camera is never held up.
 * One that vision has no time for is recorded without a depth, and counted. On a clock that
 * stands still there is no camera thread: who moves the clock calls step(), which waits for
 * room, so that nothing depends on how fast the computer is.
 *
 * A row of take() is of a picture that is in the kernel: the table of frames never says more
 * than the file holds.
 */
#ifndef INCISE_FRAME_PUMP_H
#define INCISE_FRAME_PUMP_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/camera.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/vision.h>
#include "../frames.h"

struct incise_frame_pump_setup {
	/* Nobody else reads it meanwhile. What it shot before is passed over, and not lost. */
	struct incise_camera *camera;
	struct incise_clock *clock;	     /* the rig's */
	struct incise_vision *vision;	     /* NULL: none; nobody else's meanwhile */
	struct incise_frames_writer *writer; /* the pump's from now on, which closes it */
};

/* A picture that is in the file; a row of the table frames. */
struct incise_frame_record {
	uint64_t seq;
	int64_t t_ns, arrival_ns;
	int64_t pts_ms;
	uint32_t bytes, crc;
	/* Of vision. NaN: not looked at, or no handle found (then the quality is 0). */
	double length_px, sd_px, depth_mm, quality;
};

struct incise_frame_pump_stats {
	uint64_t read;	  /* from the camera */
	uint64_t written; /* in the file */
	uint64_t lost;	  /* by the camera, since the pump began */
	uint64_t
		dropped; /* read, but there was no room: the disk or the encoder is late */
	uint64_t unwritten;	/* read, but the file had failed */
	uint64_t unlooked;	/* vision was late */
	uint64_t unrecorded;	/* written, but take() was not called for a minute */
	uint64_t waiting, room; /* slots, now */
	uint64_t waiting_most;
	int64_t bytes;	/* of the pictures written */
	bool real_time; /* the camera thread got SCHED_FIFO */
	/* Why the camera or the file is at its end; code 0: it is not. */
	struct incise_error camera, file;
};

struct incise_frame_pump;

/*
 * Begin. NULL with errno EINVAL, ENOMEM, EAGAIN (no thread); the writer is closed then.
 */
struct incise_frame_pump *incise_frame_pump_new(
	const struct incise_frame_pump_setup *setup, struct incise_error *err);

/*
 * On a clock that stands still: look for a picture. On one that runs it does nothing.
 * 1 with one, 0, or the error of the camera. Blocks while there is no room.
 */
int incise_frame_pump_step(struct incise_frame_pump *pump);

/* At most @n records, oldest first. One thread. Neither blocks nor makes a system call. */
int incise_frame_pump_take(struct incise_frame_pump *pump,
			   struct incise_frame_record *records, int n);

/* Any thread but those of the pump. */
void incise_frame_pump_stats(struct incise_frame_pump *pump,
			     struct incise_frame_pump_stats *stats);

/*
 * End the camera thread, write what waits, close the file; take() gives the rest behind it.
 * 0; the error that ended the file; -ETIMEDOUT: the disk has not answered for
 * @patience_ns, not even for a single picture; what waits is given up, and the thread that
 * hangs is left alone.
 */
int incise_frame_pump_stop(struct incise_frame_pump *pump, int64_t patience_ns,
			   struct incise_error *err);

/* Stops it first, with a patience of 5 s, if that was not done. NULL is allowed. */
void incise_frame_pump_free(struct incise_frame_pump *pump);

#endif
