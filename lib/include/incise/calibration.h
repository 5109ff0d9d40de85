/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What turns raw readings into millimetres and newtons. `incise calibrate` measures it;
 * without a file the paper's figures are taken.
 */
#ifndef INCISE_CALIBRATION_H
#define INCISE_CALIBRATION_H

#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Coefficients; the names are the keys of calibration.conf. */
struct incise_calibration {
	double force_mV_N; /**< sensitivity; nominal 1240 (paper 1, §2) */
	double force_zero_mV; /**< reading without load; NAN: measured at each recording's start */
	double depth_mm_px; /**< nominal 47.5/400 = 0.11875; the paper prints 0.118 */
	/* From acquisition to the quickest arrival, or to the stamp where there is one, and
	 * its standard deviation; NAN: what the device says of itself, sd not known. */
	double force_delay_ms, force_delay_sd_ms;
	double tracker_delay_ms, tracker_delay_sd_ms;
	double camera_delay_ms, camera_delay_sd_ms;
};

/** The paper's figures. */
INCISE_API void incise_calibration_nominal(struct incise_calibration *calibration);

/**
 * Read calibration.conf; keys that are absent keep their nominal value.
 *
 * @return 0; negative errno of fopen(3), -EINVAL (syntax, unknown key, a value out of
 *         range: file and line are named).
 */
INCISE_API int incise_calibration_load(const char *path,
				       struct incise_calibration *calibration,
				       struct incise_error *err);

INCISE_END_DECLS
#endif
