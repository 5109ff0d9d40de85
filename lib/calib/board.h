/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Views of a board, inside: the unknowns are the lens and a pose per view.
 *
 *     mm of the board ─ pose ─ mm before the lens ─ pinhole ─ Brown's lens ─ px
 */
#ifndef INCISE_BOARD_PRIVATE_H
#define INCISE_BOARD_PRIVATE_H

#include <incise/calibrate_depth.h>

#define BOARD_LENS 8 /* numbers of struct incise_board_lens */
#define BOARD_POSE 6 /* rotation vector, then the board's origin, mm */

union board_lens {
	struct incise_board_lens by_name;
	double number[BOARD_LENS];
};

/* All that was fitted. */
struct board_solution {
	union board_lens lens;
	double pose[INCISE_BOARD_VIEWS][BOARD_POSE];
	int n_unknowns;
	double *covariance; /* n_unknowns squared; views that are not believed have none */
	int plane_at;	    /* where the plane's pose begins in it */
};

/* Rotation matrix of a vector, row by row; and the other way. */
void board_rotation(const double vector[3], double r[9]);
void board_rotation_vector(const double r[9], double vector[3]);

/* Where a point of the board is in the picture, r being of the pose. */
void board_project(const union board_lens *lens, const double r[9], const double t[3],
		   const double mm[2], double px[2]);

/* x/z and y/z of what is seen at px. */
void board_undistort(const union board_lens *lens, const double px[2], double ray[2]);

/* Where the line of sight meets the board's plane. */
void board_meet(const union board_lens *lens, const double pose[BOARD_POSE],
		const double px[2], double mm[2]);

/* mm of a corner. */
void board_corner(const struct incise_board_views *views, int corner, double mm[2]);

/*
 * First values: of each view a homography, of all a focal length, with the principal point
 * in the picture's middle and no distortion. 0, -EDOM.
 */
int board_start(const struct incise_board_views *views, struct board_solution *solution,
		struct incise_error *err);

/* What the solution says of the plane: scale, tilt, residual, budget. */
void board_scale(const struct incise_board_views *views,
		 const struct board_solution *solution, struct incise_board_fit *fit);

#endif
