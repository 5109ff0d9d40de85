/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Recalibration of a recording after the fact: another calibration.conf in its folder, by which
 * all readers see its rows from then on. The recorded data stay as they are, bit for bit, and
 * their own calibration can be made active again. Part of libincise-record.
 *
 *     NAME.rec/recording.db                              rows, and the calibration of the capture
 *     NAME.rec/calibration/0001-20261127T054012Z.conf    a later one
 *     NAME.rec/calibration/0002-20261128T090000Z.original   back to that of the capture
 *     NAME.rec/calibration/0003-20261203T101500Z.conf    the last one is active
 */
#ifndef INCISE_RECALIBRATION_H
#define INCISE_RECALIBRATION_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** A calibration that a recording has, or had. */
struct incise_recalibration {
	/** In the recording's folder, calibration/0001-….conf; empty: the capture's. */
	char file[160];
	char date[32]; /**< UTC, as in 2026-11-27T05:40:12Z; empty for the capture's */
	/** Makes the calibration of the capture active again. */
	bool original;
	bool active;
	/** SHA-256 of the file, in hexadecimal; empty for one without a content. */
	char sha256[65];
};

/**
 * Calibrations of a recording, oldest first; the first one is the capture's.
 *
 * Values come from the folder as it is now. It opens no database, and does not read the
 * calibrations, so it works where a file is damaged. Each member of a joined recording has its
 * own: give the path of the member.
 *
 * @param path as for incise_recording_open(), without a choice of members
 * @param list to be freed with free(3)
 * @return number of calibrations, at least 1; -ENOENT (no such recording), negative errno of
 *         opendir(3) and read(2), -EFBIG (a calibration larger than 16 MiB), -ENOMEM
 */
INCISE_API int incise_recalibrations(const char *path, struct incise_recalibration **list,
				     struct incise_error *err);

/**
 * Recalibrate a recording: copy a calibration.conf into its folder, byte for byte, and make it
 * active; or make the calibration of the capture active again. Recordings that are open keep
 * theirs.
 *
 * Readers then use the values that the file has: sensitivity and zero of a force channel in
 * volts, the camera's scale, the tip of the blade, and delays. Depth and speed are computed from
 * the poses again if the tip differs. Values that the file does not have stay the capture's, and
 * so does the surface, which no calibration has.
 *
 * @param path        one recording; of a joined one, the path of a member
 * @param calibration file to copy; NULL: the calibration of the capture
 * @param made        the new one; or NULL
 * @return 0; as incise_calibration_load() and incise_recording_open(); -EINVAL (a joined
 *         recording), -EBUSY (it is being recorded), -EALREADY (the calibration of the capture
 *         is active), -E2BIG (9999 calibrations), negative errno of mkdir(2) and
 *         incise_outfile_commit()
 */
INCISE_API int incise_recalibrate(const char *path, const char *calibration,
				  struct incise_recalibration *made,
				  struct incise_error *err);

/**
 * The calibration by which an open recording is read.
 *
 * @param active .file is empty for the capture's; for a joined recording it belongs to the first
 *               member with another one, NAME/calibration/0001-….conf
 */
INCISE_API void incise_recording_recalibration(const struct incise_recording *recording,
					       struct incise_recalibration *active);

INCISE_END_DECLS
#endif
