/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From a board to the camera's frame and back. A pose is a rotation vector, then the board's
 * origin in mm.
 *
 *     mm of the board ─ pose ─ mm before the lens ─ pinhole ─ Brown's lens ─ px
 */
#ifndef INCISE_BOARD_LENS_H
#define INCISE_BOARD_LENS_H

#include <incise/calibrate_depth.h>

#define BOARD_LENS 8 /* numbers of struct incise_board_lens */
#define BOARD_POSE 6

union board_lens {
	struct incise_board_lens by_name;
	double number[BOARD_LENS];
};

/* Rotation matrix of a vector, row by row; and the other way. */
void board_rotation(const double vector[3], double r[9]);
void board_rotation_vector(const double r[9], double vector[3]);

/* Pixel of a point of the board, r being the pose's rotation and t its origin. */
void board_project(const union board_lens *lens, const double r[9], const double t[3],
		   const double mm[2], double px[2]);

/* x/z and y/z of the line of sight through a pixel. */
void board_undistort(const union board_lens *lens, const double px[2], double ray[2]);

/* Point where the line of sight meets the board's plane. */
void board_meet(const union board_lens *lens, const double pose[BOARD_POSE],
		const double px[2], double mm[2]);

#endif
