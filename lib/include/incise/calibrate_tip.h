/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Position of the blade's tip in the frame of the tracker's sensor, from poses of a tool that
 * rotates about its tip in a dimple (pivot calibration). Part of libincise-learn.
 *
 *        sensor  p_i, R_i          p_i + R_i t = c   for all poses i
 *           \   |   /
 *          t \  |  /               in one linear step [R_i -I][t; c] = -p_i, as in
 *             \ | /                Yaniv, Which pivot calibration?, SPIE 9415 (2015)
 *     ─────────`o'──────── c, the dimple
 *
 * The effect of noise: a position noise of s mm and an orientation noise of a rad move a
 * pose's equations by s along the tool, and by hypot(s, a |t|) across it: 0.02 mm and 0.025
 * degrees are 0.03 mm at 50 mm and 0.05 mm at 100 mm. The tip's standard uncertainty across
 * the tool is roughly this hypot() divided by sin(cone / 4) √N: 0.1 mm (k = 2) needs N = 16
 * independent poses at 100 mm and a cone of 60 degrees, and 1000 poses give 0.012 mm. The
 * distortion of the tracker does not average out; the residuals show it.
 */
#ifndef INCISE_CALIBRATE_TIP_H
#define INCISE_CALIBRATE_TIP_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_TIP_CONE_DEG 60.0  /**< smallest cone */
#define INCISE_TIP_LEAST_DEG 20.0 /**< smaller: rotation about one axis only */
#define INCISE_TIP_POSES_MIN 20	  /**< smallest number of independent poses */

/** One pose of the sensor. */
struct incise_tip_pose {
	int64_t t_ns; /**< ascending; the number of a pose without a time */
	double position_mm[3];
	double quaternion[4]; /**< w first; from the sensor's to the tracker's frame */
};

/** The result; on error, as far as it is known. */
struct incise_tip_fit {
	double tip_mm[3];     /**< t, in the sensor's frame */
	double covariance[9]; /**< covariance of t, mm², row by row */
	double pivot_mm[3];   /**< c, in the tracker's frame */
	double rms_mm;	      /**< of the inliers' residuals, over all three components */
	double largest_mm;    /**< of the inliers' residuals */
	/** cross-validation: rms of alternate blocks, fitted to the others */
	double held_out_mm;
	double cone_deg;  /**< largest angle between two directions of the tool */
	double least_deg; /**< the same for the direction that rotated least */
	double least[3];  /**< that direction, in the sensor's frame */
	double condition; /**< condition of [R -I] */
	double moved_mm;  /**< trend of the pivot from the first pose to the last */
	double moved_sd_mm;
	int n, inliers;
	int block;  /**< successive poses with correlated residuals, counted as one */
	int blocks; /**< number of blocks */
};

/**
 * Fit the tip. Least trimmed squares detect outliers, and least squares omit them. The
 * covariance comes from sums over blocks of residuals (cluster sandwich), so that it is valid
 * for three equations per pose, for noise that differs across and along the tool, and for
 * noise that is correlated in time.
 *
 * @param poses  n poses
 * @param inlier array of n, or NULL: true for those that were used
 * @param fit    set as far as known even on error
 * @return 0; -EINVAL (a number that is not finite, or an invalid quaternion; the message names
 *         the pose), -EDOM (too few poses, rotation about one axis only, a cone below 60
 *         degrees, more than 30 % outliers, residuals above 1 mm, a pivot that moved; the
 *         message names it), -ENOMEM.
 */
INCISE_API int incise_calibrate_tip(const struct incise_tip_pose *poses, int n,
				    bool *inlier, struct incise_tip_fit *fit,
				    struct incise_error *err);

INCISE_END_DECLS
#endif
