/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Writing a recording: NAME.rec/recording.db (SQLite, WAL). The folder is called
 * NAME.rec.part/ until it is complete, so that a NAME.rec is always complete; a .part of a
 * crashed program is readable up to its last commit. Part of libincise-record.
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
#include <incise/wall.h>

INCISE_BEGIN_DECLS

/** Options of a recording. */
struct incise_recorder_setup {
	const struct incise_calibration *calibration;
	/** Path of its file, whose text becomes part of the recording; or NULL. */
	const char *calibration_path;
	/**
	 * Detection of the scalpel in frames; NULL: record frames only. depth_mm_px of the
	 * calibration replaces its own.
	 */
	const struct incise_vision_setup *vision;
	/** expected duration, to check the disk's free space; 0: unknown */
	double planned_s;
	/**
	 * Start armed: samples are read and shown, but not written until a trigger; the
	 * recording then starts with the samples of the previous second.
	 */
	bool armed;
	/**
	 * Armed: triggers in addition to incise_recorder_trigger(): size of the force, once its
	 * zero is known (0: off), and a press of the stylus's button.
	 */
	double trigger_force_N;
	bool trigger_button;
	bool cuts; /**< write start and end of each cut as events "cut" */
	/**
	 * Source of wall time; see incise-capture(1), --clock-source. NULL: "auto", and no
	 * source for a simulated clock.
	 */
	const char *clock_source;
};

/** State of a recorder: rows, losses, last samples, streams. */
struct incise_recorder_stats {
	uint64_t force, tracker, depth, frames; /**< rows */
	/** poses of tracker rows; unusable ones give no depth */
	struct incise_pose_counts poses;
	uint64_t force_lost, tracker_lost, frames_lost;
	uint64_t frames_unlooked; /**< frames not analysed for lack of time */
	uint64_t force_clipped;	  /**< codes at either end of the range */
	double depth_mm;	  /**< last depth, from the tracker */
	double camera_depth_mm;	  /**< last depth, from vision; NAN: no depth */
	double force_N;		  /**< last force; 0 until the zero is known */
	double full_scale_N;	  /**< largest force of the channel */
	double zero_mV;		  /**< NAN until known */
	bool button;		  /**< button of the stylus */
	bool armed;		  /**< waits for a trigger */
	double bytes_per_s;	  /**< written to the disk */
	double disk_s;		  /**< until the disk is full; INFINITY: unknown */
	struct incise_stream streams[INCISE_STREAMS_MAX]; /**< streams with their times */
	int n_streams;					  /**< 2 or 3 */
};

struct incise_recorder;

/**
 * Check the text of a source of wall time, without asking the source.
 *
 * @return 0; -EINVAL (*err says what there is), -ENOMEM. Thread-safe.
 */
INCISE_API int incise_recorder_check_clock_source(const char *source,
						  struct incise_error *err);

/**
 * Start a recording of a rig's tracker and force channel, and of its camera if that is open.
 *
 * @param path  folder NAME.rec; must not exist
 * @param rig   opened with INCISE_RIG_TRACKER | INCISE_RIG_FORCE, optionally with
 *              INCISE_RIG_CAMERA; not owned. Its haptic device is placed by the calibration.
 * @param setup not used after the call
 * @return recorder, to be ended with incise_recorder_close(); NULL with errno EEXIST, EINVAL
 *         (a path without a name; vision's thresholds; the source of wall time), ENODEV (the rig has neither a tracker nor
 *         force channel, or none for the force that triggers), EOPNOTSUPP (its tracker reads more than one sensor), ENOSPC (too
 *         little space for planned_s), ENODATA (the program of a source of wall time that was
 *         named does not answer for 2 s), errno of mkdir(2), EIO, ENOMEM; ENOENT, ENOEXEC (a
 *         module for frames is not installed, or broken).
 */
INCISE_API struct incise_recorder *incise_recorder_new(
	const char *path, struct incise_rig *rig,
	const struct incise_recorder_setup *setup, struct incise_error *err);

/**
 * Read the samples since the last call and write them. Call it at least 10 times a second.
 * Commits every 100 ms of the rig's clock. The failure of a device is an event, and the others
 * continue: see incise_recorder_stats::streams.
 *
 * @return 0; 1: close it now, because the disk is nearly full or no device is left; *err has
 *         the cause; -ENOSPC (disk full), -EIO, -EBUSY (the tool was in contact while the zero
 *         was measured). After an error call only incise_recorder_close().
 */
INCISE_API int incise_recorder_poll(struct incise_recorder *recorder,
				    struct incise_error *err);

/** Start an armed recorder. The next poll writes the samples of the previous second. */
INCISE_API void incise_recorder_trigger(struct incise_recorder *recorder);

/**
 * Add a row to the table of events, of kind "marker" or "cut", with the clock's time.
 *
 * @return 0, or a negative errno of the disk; then call only incise_recorder_close()
 */
INCISE_API int incise_recorder_mark(struct incise_recorder *recorder, const char *kind,
				    const char *text, struct incise_error *err);

/** Get the state of the recording. */
INCISE_API void incise_recorder_stats(const struct incise_recorder *recorder,
				      struct incise_recorder_stats *stats);

/**
 * Stop reading samples, and write the waiting ones: up to 5 s for frames. The stats are final
 * afterwards; close() completes the recording.
 *
 * @return 0; negative errno of incise_recorder_poll()
 */
INCISE_API int incise_recorder_end(struct incise_recorder *recorder,
				   struct incise_error *err);

/**
 * End and rename the recording; frees @recorder in any case. Calls incise_recorder_end() if
 * necessary.
 *
 * @return 0, or a negative errno if it could not be completed; the committed data then remain
 *         readable in NAME.rec.part.
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
