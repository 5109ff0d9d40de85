/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The place of the blade's tip in the frame of the tracker's sensor, from poses of a tool
 * that turns about its tip in a dimple (pivot calibration). Part of libincise-learn.
 *
 *        sensor  p_i, R_i          p_i + R_i t = c   for all poses i
 *           \   |   /
 *          t \  |  /               in one linear step [R_i -I][t; c] = -p_i, as in
 *             \ | /                Yaniv, Which pivot calibration?, SPIE 9415 (2015)
 *     ─────────`o'──────── c, the dimple
 *
 * The effect of noise: a position noise of s mm and an orientation noise of a rad move a
 * pose's equations by s along the tool, and by hypot(s, a |t|) across it: 0.02 mm and
 * 0.025 degrees are 0.03 mm at 50 mm and 0.05 mm at 100 mm. The tip's standard uncertainty
 * across the tool is that divided by sin(cone / 4) √N, roughly: 0.1 mm (k = 2) need N = 16
 * independent poses at 100 mm and a cone of 60 degrees, and 1000 of them give 0.012 mm. What
 * does not average out is the tracker's distortion, which the residuals show.
 */
#ifndef INCISE_CALIBRATE_TIP_H
#define INCISE_CALIBRATE_TIP_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_TIP_CONE_DEG 60.0  /**< a smaller cone is refused */
#define INCISE_TIP_LEAST_DEG 20.0 /**< below, it turned about one axis only */
#define INCISE_TIP_POSES_MIN 20	  /**< that are independent */

/** One pose of the sensor. */
struct incise_tip_pose {
	int64_t t_ns; /**< ascending; of poses without times their number */
	double position_mm[3];
	double quaternion[4]; /**< w first; turns the sensor's frame into the tracker's */
};

/** The result; as far as it got, if it is refused. */
struct incise_tip_fit {
	double tip_mm[3];     /**< t, in the sensor's frame */
	double covariance[9]; /**< of it, mm², row by row */
	double pivot_mm[3];   /**< c, in the tracker's frame */
	double rms_mm; /**< of the inliers' residuals, all three components together */
	double largest_mm; /**< of the inliers' residuals */
	double held_out_mm; /**< rms of each half under the fit of the other; blocks in turns */
	double cone_deg;  /**< largest angle between two directions of the tool */
	double least_deg; /**< the same of the direction that turned least */
	double least[3];  /**< that one, in the sensor's frame */
	double condition; /**< of [R -I] */
	double moved_mm;  /**< trend of the pivot from the first pose to the last */
	double moved_sd_mm;
	int n, inliers;
	int block;  /**< poses in a row that count as one, as their residuals are alike */
	int blocks; /**< how many of these there are */
};

/**
 * Fit. Poses far from the pivot are found by least trimmed squares, and left out of the
 * least squares. The covariance is of sums over blocks of residuals (a cluster sandwich), so
 * that it is right for three equations per pose, for noise that is not alike across and along
 * the tool, and for a stream whose noise is correlated in time.
 *
 * @param poses  n of them
 * @param inlier array of n, or NULL: true for those that were used
 * @param fit    filled in as far as it got in any case
 * @return 0; -EINVAL (a number that is not finite, a quaternion that is none: the pose is
 *         named), -EDOM (refused: too few poses, turning about one axis only, a cone below
 *         60 degrees, more than 30 % outliers, residuals above 1 mm, a pivot that moved: the
 *         line says which), -ENOMEM.
 */
INCISE_API int incise_calibrate_tip(const struct incise_tip_pose *poses, int n,
				    bool *inlier, struct incise_tip_fit *fit,
				    struct incise_error *err);

INCISE_END_DECLS
#endif
