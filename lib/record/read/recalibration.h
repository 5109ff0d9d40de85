/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The active calibration of a recording, applied to what is read of it; for lib/record only, so that
 * all readers agree:
 *
 *     meta      a temporary table of this connection, with the calibration's keys
 *     depth     from the poses and the calibrated tip  ╮
 *     frames    depth in another scale                 ╰ see source.h
 *     times     less the delays: see rows.h
 */
#ifndef INCISE_RECALIBRATION_PRIVATE_H
#define INCISE_RECALIBRATION_PRIVATE_H

#include <incise/calibration.h>
#include <incise/infile.h>
#include <incise/recalibration.h>
#include "recording.h"

/* The calibration by which a recording is read, if it is not the capture's. */
struct incise_recalibrated {
	struct incise_recalibration entry;
	struct incise_calibration calibration; /* delays NAN: those of the capture */
	double depth_scale; /* of depths by vision; 1: as they were captured */
};

/*
 * Find the active calibration, and apply it; rec->meta is that of the capture, and
 * is to be read again if rec->recalibrated is set. Returns 0 or -errno.
 */
int incise_recalibration_apply(struct incise_recording *rec, struct incise_error *err);

/* Move the times of a source by a calibration; one without its delay moves nothing. */
void incise_recalibration_shift(const struct incise_calibration *calibration,
				const struct incise_stream_source *source,
				int64_t *shift_ns, double *variance_ns2);

/* Delays of a stream and their uncertainty by a calibration. */
void incise_recalibration_stream(const struct incise_calibration *calibration,
				 struct incise_stream *stream);

/* "of the recording", or which one since when, for people; to be freed; NULL: no memory. */
char *incise_recalibration_text(const struct incise_recording *rec);

/* --- the folder ------------------------------------------------------------------------ */

#define INCISE_RECALIBRATION_FOLDER "calibration" /* in that of the recording */

/* As the recorder keeps of one: with the history of years. */
extern const struct incise_infile_kind incise_recalibration_kind;

/* "0001-20261127T054012Z.conf"; false: no calibration. */
bool incise_recalibration_parse(const char *name, struct incise_recalibration *entry);

/* Open it: a descriptor, or -errno; -ENOENT is no error. */
int incise_recalibration_folder(const char *folder, struct incise_error *err);

/* Its entries behind that of the capture, in order, to be freed in any case; returns how many there are. */
int incise_recalibration_list(const char *folder, struct incise_recalibration **list,
			      struct incise_error *err);

#endif
