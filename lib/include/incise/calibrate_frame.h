/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Place of a haptic device in the scene, from three to six points that its handle touched. Part
 * of libincise-learn.
 *
 *     p_i = R d_i + o + noise       p_i: a point of the scene, d_i: the handle there
 *
 * The rotation is Horn's (J. Opt. Soc. Am. A 4, 1987): the eigenvector of a matrix of 4 × 4, so
 * that it is never a mirror. A point that is touched to s mm moves the turn by about s / r, r the
 * distance of the points from the line that it turns about.
 */
#ifndef INCISE_CALIBRATE_FRAME_H
#define INCISE_CALIBRATE_FRAME_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_FRAME_POINTS_MIN 3  /**< fewest points */
#define INCISE_FRAME_POINTS_MAX 6  /**< most points */
#define INCISE_FRAME_APART_MM 10.0 /**< smallest distance of two points */
#define INCISE_FRAME_RMS_MM 2.0	   /**< largest residual, rms */

/** A point, and the handle while it touched it. */
struct incise_frame_point {
	double scene_mm[3];
	double device_mm[3]; /**< mean of the handle, in the device's frame */
	double sd_mm;	     /**< of its samples, along one axis; 0: not known */
};

/** The result; on error, as far as it is known. */
struct incise_frame_fit {
	/** R as an axis, in the scene, times the angle. */
	double turn_deg[3];
	double origin_mm[3];   /**< o: the device's origin in the scene */
	double covariance[36]; /**< of turn_deg and origin_mm, row by row */
	double residual_mm[INCISE_FRAME_POINTS_MAX]; /**< length, point by point */
	double rms_mm;				     /**< of these */
	int freedom;	   /**< degrees of freedom of the residuals, 3 n - 6 */
	double spread_mm;  /**< rms of sd_mm */
	double u_touch_mm; /**< standard uncertainty of a point along one axis */
	double scale;	   /**< the touched points' distances over the scene's */
	/** They lie in a plane, in which a mirrored axis does not show. */
	bool flat;
};

/**
 * Fit the frame. The uncertainty of a point is the larger of its spread and of what the residuals
 * say, with Student's factor for their degrees of freedom. Thread-safe; not real-time safe.
 *
 * @return 0; -EINVAL (a number that is not finite, or beyond 1e6 mm), -EDOM (fewer than 3 points or more
 *         than 6, two of them closer than 10 mm, nearly on a line, mirrored, residuals above 2
 *         mm; the message names it)
 */
INCISE_API int incise_calibrate_frame(const struct incise_frame_point *points, int n,
				      struct incise_frame_fit *fit,
				      struct incise_error *err);

INCISE_END_DECLS
#endif
