/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inner corners of a chessboard in a frame, for incise_calibrate_depth_board(). The module
 * board_opencv.so uses OpenCV (incise/backend.h). The first call maps it into the process,
 * where it remains.
 *
 *     ■□■□■     a board of 4 × 3 squares has 3 × 2 inner corners; use odd by even or even by
 *     □■□■□     odd, so that its orientation is unique, and leave a square's width of white
 *     ■□■□■     around it
 */
#ifndef INCISE_BOARD_H
#define INCISE_BOARD_H

#include <incise/camera.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/**
 * Find all corners, to some hundredths of a pixel (A. Duda, U. Frese, Accurate detection and
 * localization of checkerboard corners for calibration, BMVC 2018). Takes 0.05 s or more, and
 * some seconds if there is no board.
 *
 * @param columns, rows inner corners, 3 to 100 each
 * @param corners array of 2 · columns · rows: x, y of each, row by row; pixel (0, 0) covers
 *        0 … 1. Unchanged unless 0 is returned.
 * @return 0; -ENODATA (no such board in the frame, or not all of it), -EINVAL (invalid
 *         sizes), -EBADMSG (a JPEG that cannot be decoded), -ENOENT (the module is not
 *         installed), -ENOEXEC (it is broken, or lacks a library), -ENOMEM, -EIO (OpenCV
 *         failed)
 */
INCISE_API int incise_board_find(const struct incise_camera_frame *frame, int columns,
				 int rows, double *corners, struct incise_error *err);

INCISE_END_DECLS
#endif
