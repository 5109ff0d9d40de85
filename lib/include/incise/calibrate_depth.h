/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Scale of the camera's frame in the plane of the scalpel, mm per pixel: from two points of
 * known distance, from pairs of depth and exposed length, or from a board. Part of
 * libincise-learn. No device and no file.
 *
 *     ┌──┐  ┐           two points   mm_px = length_mm / full_px
 *     │██│  │ full_px   line         depth_mm = mm_px · (full_px - length_px)
 *     │██│  │ at        board        a plane in space, seen through a lens: mm of the plane
 *     │██│  │ depth 0                per pixel of the raw frame along the handle
 *   ──┴██┴──┘──
 *
 * One scale is valid in one plane only: an object that is nearer by 1 % of the distance
 * appears 1 % larger. Standard uncertainties u follow the GUM (JCGM 100). The mean of few
 * repeats has the larger uncertainty of Student's t (JCGM 101, 6.4.9.4), so that U = 2 u
 * contains 95 %.
 *
 * Pure functions; any thread; not real-time safe.
 */
#ifndef INCISE_CALIBRATE_DEPTH_H
#define INCISE_CALIBRATE_DEPTH_H

#include <stdbool.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Smallest number of pairs for a line. */
#define INCISE_DEPTH_PAIRS_MIN 6
#define INCISE_DEPTH_SPAN_MIN_PX 20.0 /**< smallest range of lengths for a line */

/** The result; on error, as far as it is known. */
struct incise_depth_fit {
	double mm_px, u_mm_px;
	double full_px, u_full_px; /**< exposed length at depth 0 */
	double covariance;	   /**< covariance of both */
	int n, inliers;
	/** effective sample size of the inliers, for correlated noise */
	int effective;
	double sd_mm;		/**< of the inliers' residuals */
	double largest_mm;	/**< of the inliers' residuals */
	double low_px, high_px; /**< lengths of the inliers */
	/**
	 * Line: distance at the ends of a parabola through the pairs, and its standard
	 * deviation.
	 */
	double bend_mm, bend_sd_mm;
	struct incise_calibration_budget budget; /**< of mm_px */
};

/** One length, measured n times. */
struct incise_depth_points {
	double length_mm, u_length_mm;
	const double *length_px; /**< n lengths, in order of time */
	int n;
	double u_px; /**< common standard uncertainty of all lengths */
};

/**
 * Calibrate with two points. From 5 lengths on, those more than 5 robust standard deviations
 * from the median are omitted; with fewer than 10, only those also more than one pixel away.
 *
 * @param inlier array of n, or NULL: true for those that were used
 * @return 0; -EINVAL (a number that is not finite or not positive; the message names it),
 *         -EDOM (no lengths, more than 30 % outliers, an implausible scale), -ENOMEM
 */
INCISE_API int incise_calibrate_depth_points(const struct incise_depth_points *points,
					     bool *inlier, struct incise_depth_fit *fit,
					     struct incise_error *err);

/** Pairs of depth and length. */
struct incise_depth_lengths {
	const double *depth_mm;	 /**< from a gauge or the tracker */
	const double *length_px; /**< from vision */
	int n;
	double u_scale;	   /**< relative, of the gauge: 0.001 is 0.1 % */
	double u_depth_mm; /**< of the gauge's zero, common to all pairs */
};

/**
 * Fit a straight line through pairs, depth over length. It starts with repeated medians
 * (Siegel 1982), which tolerate up to half of the pairs as outliers. Pairs beyond 4 robust
 * standard deviations (more for few pairs) are omitted, and least squares are fitted to the
 * rest. The noise of the length, some hundredths of a pixel in a hundred, does not bias the
 * slope.
 *
 * @param inlier array of n, or NULL: true for those that were used
 * @return as incise_calibrate_depth_points(); -EDOM also for swapped columns, a length that
 *         grows with the depth, a single depth, too few pairs
 */
INCISE_API int incise_calibrate_depth_line(const struct incise_depth_lengths *pairs,
					   bool *inlier, struct incise_depth_fit *fit,
					   struct incise_error *err);

/* ---- board -------------------------------------------------------------------------- */

/** Largest number of views of a board. */
#define INCISE_BOARD_VIEWS 40
#define INCISE_BOARD_CORNERS 400 /**< largest number of corners of a view */

/** The camera: a pinhole with Brown's lens (1966), with OpenCV's names. */
struct incise_board_lens {
	/* px; pixel (0, 0) covers 0 … 1: OpenCV's cx and cy are smaller by 0.5. */
	double fx, fy, cx, cy;
	double k1, k2, p1, p2;
};

/** Views of a board of corners. */
struct incise_board_views {
	int columns, rows; /**< inner corners: 9 × 6 of 10 × 7 squares */
	double square_mm, u_square_mm;
	/**
	 * px, as in incise/vision.h: pixel (0, 0) covers 0 … 1. x of view v, row j, column i is
	 * at 2((v rows + j) columns + i), followed by y.
	 */
	const double *corners;
	int n;			/**< number of views */
	int plane;		/**< the view in the cutting plane */
	double u_plane_mm;	/**< u of its position along the line of sight */
	double axis_px[2][2];	/**< ends of the handle: x, y of upper and lower end */
	double region_px[2][2]; /**< region of interest: x, y of two corners */
	int width, height;	/**< size of the frame */
};

/** The result of views of a board: lens, plane and scale. u: standard uncertainty. */
struct incise_board_fit {
	struct incise_board_lens lens, u_lens;
	double mm_px, u_mm_px;	      /**< over the handle's axis */
	double low_mm_px, high_mm_px; /**< its range in the region */
	double bend_mm; /**< largest error of depth on the axis by a constant scale */
	double rms_px;	/**< of all accepted views */
	double plane_rms_mm, plane_largest_mm; /**< corners of the view in the plane */
	double tilt_deg, u_tilt_deg;	       /**< plane against frame; bound: + 2 u */
	double distance_mm; /**< from the lens to the centre of the axis */
	double spread_deg;  /**< largest angle between two views */
	/** From undistorted pixels (x, y, 1) to mm in the plane; row by row. */
	double homography[9];
	int n, views; /**< given, accepted */
	bool believed[INCISE_BOARD_VIEWS];
	double view_rms_px[INCISE_BOARD_VIEWS];
	struct incise_calibration_budget budget; /**< of mm_px */
};

/**
 * Fit lens, poses and plane to views of a board: homographies, the focal length from the
 * constraint of right angles (Zhang 2000), then all parameters by Levenberg–Marquardt on
 * pixels. A view with much larger residuals than the others is omitted. The uncertainty of the
 * scale includes the covariance of all parameters.
 *
 * @return 0; -EINVAL (sizes, numbers that are not finite), -EDOM (fewer than 3 views, all from
 *         one direction, corners that fit no board, the view in the plane is an outlier),
 *         -ENOMEM
 */
INCISE_API int incise_calibrate_depth_board(const struct incise_board_views *views,
					    struct incise_board_fit *fit,
					    struct incise_error *err);

/** Convert a point of the raw frame to mm in the plane, x and y. */
INCISE_API void incise_board_plane(const struct incise_board_fit *fit, double x_px,
				   double y_px, double mm[2]);

INCISE_END_DECLS
#endif
