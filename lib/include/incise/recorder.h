/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Writing a recording: NAME.rec/recording.db (SQLite, WAL). It is written as
 * NAME.rec.part/ and gets its name when it is complete, so that a NAME.rec is
 * always complete; a .part left by a crash is readable up to its last commit. Part of
 * libincise-record.
 */
#ifndef INCISE_RECORDER_H
#define INCISE_RECORDER_H

#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include <incise/vision.h>

INCISE_BEGIN_DECLS

/** Options of a recording. */
struct incise_recorder_setup {
	const struct incise_calibration *calibration;
	/** Its file, whose text the recording keeps; NULL: none. */
	const char *calibration_path;
	/** Find the scalpel in the camera's frames; NULL: record frames only. The
	 * calibration's depth_mm_px is used in place of its own. */
	const struct incise_vision_setup *vision;
	double planned_s; /**< for the disk's free space; 0: not known */
	/** Start armed: everything is read and shown, but nothing written until a trigger;
	 * the recording then starts with the samples of the second before. */
	bool armed;
	/** Armed: triggers besides incise_recorder_trigger(). The size of the force, once
	 * its zero is known (0: none), and a press of the stylus's button. */
	double trigger_force_N;
	bool trigger_button;
	bool cuts; /**< write start and end of each cut as events of kind "cut" */
};

/** The state of a recorder: rows, losses, the last samples, the streams. */
struct incise_recorder_stats {
	uint64_t force, tracker, depth, frames; /**< rows */
	struct incise_pose_counts poses; /**< of the tracker's rows; unusable: no depth */
	uint64_t force_lost, tracker_lost, frames_lost;
	uint64_t frames_unlooked; /**< vision had no time for them */
	uint64_t force_clipped;	  /**< codes at either end of the range */
	double depth_mm;	  /**< last, by the tracker */
	double camera_depth_mm;	  /**< last, by vision; NAN: not seen */
	double force_N;		  /**< last; 0 until the zero is known */
	double zero_mV;		  /**< NAN until known */
	bool button;		  /**< of the stylus */
	bool armed;		  /**< waits for its trigger */
	double bytes_per_s;	  /**< written to the disk */
	double disk_s;		  /**< until the disk is full; INFINITY: not known yet */
	struct incise_stream streams[INCISE_STREAMS_MAX]; /**< with their times */
	int n_streams;					  /**< 2 or 3 */
};

struct incise_recorder;

/**
 * Start a recording of a rig's tracker and force channel, and of its camera if that is open.
 *
 * @param path  folder NAME.rec; it must not exist
 * @param rig   opened with INCISE_RIG_TRACKER | INCISE_RIG_FORCE, and INCISE_RIG_CAMERA or
 *              not; not owned
 * @param setup its pointers are not kept
 * @return recorder, to be ended with incise_recorder_close(); NULL with errno EEXIST, EINVAL
 *         (a path without a name; vision's thresholds),
 *         ENODEV (the rig has no tracker or force channel), EOPNOTSUPP (its tracker reads
 *         more than one sensor), ENOSPC (no space for the planned time), of mkdir(2), EIO,
 *         ENOMEM; ENOENT, ENOEXEC (a module for frames is not installed, or broken).
 */
INCISE_API struct incise_recorder *incise_recorder_new(
	const char *path, struct incise_rig *rig,
	const struct incise_recorder_setup *setup, struct incise_error *err);

/**
 * Read the samples since the last call and write them; to be called at least 10 times
 * a second. Commits every 100 ms of the rig's clock. A device that dies is an event, and the
 * others continue: see incise_recorder_stats::streams.
 *
 * @return 0; 1: it must be closed now, because the disk is nearly full or no device is left,
 *         with the cause in *err; -ENOSPC (disk full), -EIO, -EBUSY (the tool was not free
 *         while the zero was measured). After an error only incise_recorder_close() is useful.
 */
INCISE_API int incise_recorder_poll(struct incise_recorder *recorder,
				    struct incise_error *err);

/** Armed: start. The next poll writes the samples of the second before. */
INCISE_API void incise_recorder_trigger(struct incise_recorder *recorder);

/**
 * Add a row to the table of events, of kind "marker" or "cut", with the clock's time.
 *
 * @return 0, or a negative errno of the disk, after which only closing is useful
 */
INCISE_API int incise_recorder_mark(struct incise_recorder *recorder, const char *kind,
				    const char *text, struct incise_error *err);

/** The recording so far. */
INCISE_API void incise_recorder_stats(const struct incise_recorder *recorder,
				      struct incise_recorder_stats *stats);

/**
 * Read no more samples, and write those that still wait: up to 5 s for frames. The stats are
 * final then; close() makes the recording complete.
 *
 * @return 0; as incise_recorder_poll() < 0
 */
INCISE_API int incise_recorder_end(struct incise_recorder *recorder,
				   struct incise_error *err);

/**
 * End the recording and give it its name; frees @recorder in any case. Calls
 * incise_recorder_end() if that was not done.
 *
 * @return 0, or a negative errno when it could not be completed; what was committed then
 *         stays readable as NAME.rec.part.
 */
INCISE_API int incise_recorder_close(struct incise_recorder *recorder,
				     struct incise_error *err);

/**
 * Expected time that a recording of these devices fits on a disk, by their nominal rates. Frames
 * that are coded, and MJPEG, count with an upper estimate of their size.
 *
 * @param free_bytes free on the disk; some are reserved to end the recording
 * @param tracker, force, camera streams of the recording; NULL: without
 * @return seconds, 0 or more; INFINITY without a stream. Thread-safe.
 */
INCISE_API double incise_recorder_capacity_s(double free_bytes,
					     const struct incise_tracker_info *tracker,
					     const struct incise_force_info *force,
					     const struct incise_camera_info *camera);

INCISE_END_DECLS
#endif
