/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the camera saw at the time of a row of a resampled recording: the depth by its
 * pictures, on the line between two that saw the handle.
 *
 *     pictures  ○       ●       ●        ● saw it, ○ did not
 *     row           ✗       ✓
 *
 * mm.
 */
#ifndef INCISE_CAMERA_NEAR_H
#define INCISE_CAMERA_NEAR_H

#include <stdbool.h>
#include <stdint.h>
#include "../read/rows.h"

#define INCISE_CAMERA_LOW_QUALITY 0.5

struct incise_camera_near {
	struct incise_rows rows;
	bool open;
	double scale; /* of another calibration's depths */
	double mm_px; /* of the one that is taken */
	struct incise_camera_picture {
		int64_t t_ns; /* INCISE_TIME_NONE: none */
		double depth_mm, sd_mm, quality, t_sd_s;
	} picture[2]; /* before and after the row */
};

/* NAN: not seen. */
struct incise_camera_value {
	double depth_mm;
	double sd_mm; /* of the edge in the picture */
	double u_mm;  /* with what the uncertainty of times makes of it */
	double quality;
	bool low_quality; /* of either picture, or not seen */
};

/* Whether a recording has pictures. 1, 0, -errno. */
int incise_camera_near_any(struct incise_recording *recording, struct incise_error *err);

/* Returns 0 or -errno; to be closed in any case. */
int incise_camera_near_open(struct incise_camera_near *near,
			    struct incise_recording *recording,
			    const struct incise_calibration *given,
			    struct incise_error *err);
void incise_camera_near_close(struct incise_camera_near *near);

/* At a time, not before that of the last call. Returns 0 or -errno. */
int incise_camera_near_at(struct incise_camera_near *near, int64_t t_ns, double t_sd_s,
			  struct incise_camera_value *value, struct incise_error *err);

#endif
