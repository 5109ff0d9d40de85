/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The active calibration of a recording, applied to what is read of it; for lib/record only, so that
 * all readers agree:
 *
 *     meta      a temporary table of this connection, with the calibration's keys
 *     depth     from the poses and the calibrated tip  ╮
 *     frames    depth in another scale                 ╰ see source.h
 *     times     less the delays: see incise_row_times_open()
 */
#ifndef INCISE_RECALIBRATION_PRIVATE_H
#define INCISE_RECALIBRATION_PRIVATE_H

#include <incise/calibration.h>
#include <incise/recalibration.h>
#include "recording.h"

/* Of a recording that is read by another calibration than that of its capture. */
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

/* Delays of a stream and their uncertainty by the active calibration. */
void incise_recalibration_stream(const struct incise_recording *rec,
				 struct incise_stream *stream);

/* "of the recording", or which one since when, for people; to be freed; NULL: no memory. */
char *incise_recalibration_text(const struct incise_recording *rec);

#endif
