/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Frames from a camera into its file, so that neither the camera nor the thread that records
 * the other streams waits for a disk.
 *
 *     camera thread:  read ──copy──► slots, 2.5 s ──► file thread: put() ──► records ┐
 *                       └────copy──► slots, 8 ────► vision thread ───────► results ┴─► take()
 *
 * A frame without a free slot is dropped and counted; the camera never waits. A frame that
 * vision has no time for is recorded without a depth and counted. On a simulated clock there
 * is no camera thread: the caller that moves the clock calls step(), which waits for a slot, so
 * that the result does not depend on the speed of the computer.
 *
 * take() returns records of frames that are in the kernel: the table frames never has a row
 * that the file lacks.
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
	/* Read by the pump alone. Frames from before the start are skipped, not lost. */
	struct incise_camera *camera;
	struct incise_clock *clock;	     /* the rig's */
	struct incise_vision *vision;	     /* NULL: none; used by the pump alone */
	struct incise_frames_writer *writer; /* closed by the pump */
};

struct incise_frame_pump_stats {
	uint64_t read;	     /* from the camera */
	uint64_t written;    /* in the file */
	uint64_t lost;	     /* by the camera, since the pump started */
	uint64_t dropped;    /* read, but no slot was free: disk or encoder are late */
	uint64_t unwritten;  /* read, but the file had failed */
	uint64_t unlooked;   /* vision was late */
	uint64_t unrecorded; /* written, but take() was not called for a minute */
	uint64_t waiting, capacity; /* slots, now */
	uint64_t waiting_most;
	int64_t bytes;	/* of the frames written */
	bool real_time; /* the camera thread got SCHED_FIFO */
	/* The error that ended the camera or the file; code 0: none. */
	struct incise_error camera, file;
};

struct incise_frame_pump;

/* NULL with errno EINVAL, ENOMEM, EAGAIN (no thread); the writer is closed then. */
struct incise_frame_pump *incise_frame_pump_new(
	const struct incise_frame_pump_setup *setup, struct incise_error *err);

/*
 * On a simulated clock: read a frame if there is one. On a real clock it does nothing.
 * 1 with a frame, 0, or the error of the camera. Blocks while no slot is free.
 */
int incise_frame_pump_step(struct incise_frame_pump *pump);

/*
 * Take at most @n records, oldest first. For one thread; neither blocks nor makes a system
 * call.
 */
int incise_frame_pump_take(struct incise_frame_pump *pump,
			   struct incise_frame_record *records, int n);

/* For any thread but those of the pump. */
void incise_frame_pump_stats(struct incise_frame_pump *pump,
			     struct incise_frame_pump_stats *stats);

/*
 * End the camera thread, write the waiting frames, close the file; take() returns their
 * records afterwards. 0; the error that ended the file; -ETIMEDOUT: the disk took no frame for
 * @patience_ns; the waiting frames are given up, and the thread that hangs is detached.
 */
int incise_frame_pump_stop(struct incise_frame_pump *pump, int64_t patience_ns,
			   struct incise_error *err);

/* Stops the pump first, with a patience of 5 s, if it runs. NULL is allowed. */
void incise_frame_pump_free(struct incise_frame_pump *pump);

#endif
