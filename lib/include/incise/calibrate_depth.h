/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Scale of the camera's frame in the plane of the scalpel, mm per pixel: from two points
 * of known distance, from pairs of depth and exposed length, or from a board. Part of
 * libincise-learn. No device and no file here: arrays in, numbers out.
 *
 *     ┌──┐  ┐           two points   mm_px = length_mm / full_px
 *     │██│  │ full_px   line         depth_mm = mm_px · (full_px - length_px)
 *     │██│  │ at        board        a plane in space, seen through a lens: mm of the plane
 *     │██│  │ depth 0                per pixel of the raw frame along the handle
 *   ──┴██┴──┘──
 *
 * One number holds in one plane only: what is nearer by 1 % of the distance is larger by
 * 1 %. Standard uncertainties u are after the GUM (JCGM 100); a mean of few repeats has the
 * wider one of Student's t (JCGM 101, 6.4.9.4), so that U = 2 u holds 95 %.
 *
 * Pure functions; any thread; not real-time safe.
 */
#ifndef INCISE_CALIBRATE_DEPTH_H
#define INCISE_CALIBRATE_DEPTH_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Lines that a budget has at most. */
#define INCISE_DEPTH_BUDGET 6
/** Pairs that a line needs. */
#define INCISE_DEPTH_PAIRS_MIN 6
#define INCISE_DEPTH_SPAN_MIN_PX 20.0 /**< of lengths in a line; else it is too short */

/** A line of the budget: what u it has, and what that does to mm_px. */
struct incise_depth_part {
	const char *name; /**< static */
	char type;	  /**< A: from the data's scatter; B: from knowledge */
	double u;
	const char *unit;
	double sensitivity; /**< change of mm_px per unit */
};

/** The result; as far as it got, if it is refused. */
struct incise_depth_fit {
	double mm_px, u_mm_px;
	double full_px, u_full_px; /**< exposed length at depth 0 */
	double covariance;	   /**< of both */
	int n, inliers;
	int effective;	   /**< repeats that the inliers are worth, as noise may go on */
	double sd_mm;	   /**< of the inliers' residuals */
	double largest_mm; /**< of the inliers' residuals */
	double low_px, high_px; /**< lengths of the inliers */
	/** Line: how far a parabola through the pairs leaves it at the ends, and its sd. */
	double bend_mm, bend_sd_mm;
	int n_parts;
	struct incise_depth_part part[INCISE_DEPTH_BUDGET];
};

/** One length, seen n times. */
struct incise_depth_points {
	double length_mm, u_length_mm;
	const double *length_px; /**< n, in the order they came */
	int n;
	double u_px; /**< of one length in pixels that all repeats share */
};

/**
 * Two points. Lengths further than 5 robust standard deviations from their median are left
 * out, from 5 on; of fewer than 10 only what is more than a pixel off.
 *
 * @param inlier array of n, or NULL: true for those that were used
 * @return 0; -EINVAL (a number that is not finite or not positive: it is named), -EDOM
 *         (refused: none given, more than 30 % outliers, a scale that no camera has), -ENOMEM
 */
INCISE_API int incise_calibrate_depth_points(const struct incise_depth_points *points,
					     bool *inlier, struct incise_depth_fit *fit,
					     struct incise_error *err);

/** Pairs of depth and length. */
struct incise_depth_lengths {
	const double *depth_mm;	 /**< by a gauge, or the tracker */
	const double *length_px; /**< by vision */
	int n;
	double u_scale;	   /**< of the gauge, relative: 0.001 is 0.1 % */
	double u_depth_mm; /**< of the gauge's zero, in all pairs alike */
};

/**
 * A straight line through pairs, depth on length. It starts from repeated medians (Siegel
 * 1982), which bear half of the pairs wrong; pairs further than 4 robust standard
 * deviations, more of few, are left out, and least squares fitted to the rest. Noise of the length, some
 * hundredths of a pixel over a hundred, does not bend the slope.
 *
 * @param inlier array of n, or NULL: true for those that were used
 * @return as incise_calibrate_depth_points(); -EDOM too for columns that are swapped, a
 *         length that grows with the depth, one depth only, too few pairs
 */
INCISE_API int incise_calibrate_depth_line(const struct incise_depth_lengths *pairs,
					   bool *inlier, struct incise_depth_fit *fit,
					   struct incise_error *err);

/* ---- board -------------------------------------------------------------------------- */

/** Frames of a board that are taken at most. */
#define INCISE_BOARD_VIEWS 40
#define INCISE_BOARD_CORNERS 400 /**< of one view */

/** The camera: Brown's lens (1966) before a pinhole, by OpenCV's names. */
struct incise_board_lens {
	/* px; pixel (0, 0) covers 0 … 1: OpenCV's cx and cy are less by a half. */
	double fx, fy, cx, cy;
	double k1, k2, p1, p2;
};

/** Views of a board of corners. */
struct incise_board_views {
	int columns, rows; /**< inner corners: 9 × 6 of 10 × 7 squares */
	double square_mm, u_square_mm;
	/** px; as incise/vision.h: pixel (0, 0) covers 0 … 1. Of view v, row j, column i the
	 * x at 2((v rows + j) columns + i), y behind it. */
	const double *corners;
	int n;		      /**< views */
	int plane;	      /**< the one that lies in the cutting plane */
	double u_plane_mm;    /**< how well it lies there, along the line of sight */
	double axis_px[2][2]; /**< ends of the handle: x, y of the upper, of the lower */
	double region_px[2][2]; /**< of interest: x, y of two corners */
	int width, height;	/**< of the frame */
};

/** The result of views of a board: lens, plane and scale. u: standard uncertainty. */
struct incise_board_fit {
	struct incise_board_lens lens, u_lens;
	double mm_px, u_mm_px;	      /**< over the axis from end to end */
	double low_mm_px, high_mm_px; /**< least and largest of it within the region */
	double bend_mm; /**< largest error of depth for one number, on the axis */
	double rms_px;	/**< of all views that were believed */
	double plane_rms_mm, plane_largest_mm; /**< corners of the view in the plane */
	double tilt_deg,
		u_tilt_deg; /**< of the plane against the frame's; bound: + 2 u */
	double distance_mm; /**< from the lens to the middle of the axis */
	double spread_deg;  /**< largest angle between two views */
	/** From undistorted pixels, x, y, 1 by the lens, to mm of the plane; row by row. */
	double homography[9];
	int n, views; /**< given, believed */
	bool believed[INCISE_BOARD_VIEWS];
	double view_rms_px[INCISE_BOARD_VIEWS];
	int n_parts;
	struct incise_depth_part part[INCISE_DEPTH_BUDGET];
};

/**
 * Lens, poses and the plane from views of a board: homographies, the focal length from what
 * keeps right angles right (Zhang 2000), then all at once by Levenberg and Marquardt on
 * pixels. A view that is far worse than the others is left out. The covariance of all
 * unknowns goes into that of the scale.
 *
 * @return 0; -EINVAL (sizes, numbers that are not finite), -EDOM (refused: fewer than 3
 *         views, all from one direction, corners that fit no board, the plane's own view is
 *         an outlier), -ENOMEM
 */
INCISE_API int incise_calibrate_depth_board(const struct incise_board_views *views,
					    struct incise_board_fit *fit,
					    struct incise_error *err);

/** mm on the plane, x and y, of a point of the raw frame. */
INCISE_API void incise_board_plane(const struct incise_board_fit *fit, double x_px,
				   double y_px, double mm[2]);

INCISE_END_DECLS
#endif
