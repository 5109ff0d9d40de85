/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Writing a recording: NAME.rec/recording.db (SQLite, WAL). It is written as
 * NAME.rec.part/ and takes its name when it is closed whole, so that a NAME.rec is
 * always complete; a .part left by a crash is readable up to its last commit. Part of
 * libincise-record.
 */
#ifndef INCISE_RECORDER_H
#define INCISE_RECORDER_H

#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/rig.h>

INCISE_BEGIN_DECLS

/** Counts of what a recorder has written. */
struct incise_recorder_stats {
	uint64_t force, tracker, depth; /**< rows */
	uint64_t force_lost, tracker_lost;
	uint64_t force_clipped; /**< codes at either end of the range */
	double depth_mm;	/**< last */
	double force_N;		/**< last; 0 until the zero is known */
	double zero_mV;		/**< NAN until known */
};

struct incise_recorder;

/**
 * Start a recording of a rig's tracker and force channel.
 *
 * @param path  folder NAME.rec; it must not exist
 * @param rig   opened with INCISE_RIG_TRACKER | INCISE_RIG_FORCE; not owned
 * @return recorder, to be ended with incise_recorder_close(); NULL with errno EEXIST, EINVAL
 *         (a path that is no name),
 *         ENODEV (the rig has no tracker or force channel), EOPNOTSUPP (its tracker reads
 *         more than one sensor), of mkdir(2), EIO, ENOMEM.
 */
INCISE_API struct incise_recorder *incise_recorder_new(
	const char *path, struct incise_rig *rig,
	const struct incise_calibration *calibration, struct incise_error *err);

/**
 * Take what has arrived since the last call and write it; to be called at least 10 times
 * a second. Commits every 100 ms of the rig's clock.
 *
 * @return 0; -ENOSPC (disk full), -EIO, -ENODEV (a device is gone), -EBUSY (the tool was not
 *         free while the zero was measured). After an error only
 *         incise_recorder_close() makes sense.
 */
INCISE_API int incise_recorder_poll(struct incise_recorder *recorder,
				    struct incise_error *err);

INCISE_API void incise_recorder_stats(const struct incise_recorder *recorder,
				      struct incise_recorder_stats *stats);

/**
 * End the recording and give it its name; frees @recorder in any case.
 *
 * @return 0, or a negative errno when it could not be completed; what was committed then
 *         stays readable as NAME.rec.part.
 */
INCISE_API int incise_recorder_close(struct incise_recorder *recorder,
				     struct incise_error *err);

INCISE_END_DECLS
#endif
