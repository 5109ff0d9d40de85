/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inner corners of a chessboard in a picture, for incise_calibrate_depth_board(). A module
 * on OpenCV does it, board_opencv.so (incise/backend.h), which the first call maps into the
 * process, to stay there; who never calls never maps it.
 *
 *     ■□■□■     a board of 4 × 3 squares has 3 × 2 inner corners; give odd by even or
 *     □■□■□     even by odd, so that it has no second way to lie, and leave a square's
 *     ■□■□■     width of white around it
 */
#ifndef INCISE_BOARD_H
#define INCISE_BOARD_H

#include <incise/camera.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/**
 * Find all corners, to some hundredths of a pixel (A. Duda, U. Frese, Accurate detection and
 * localization of checkerboard corners for calibration, BMVC 2018). Takes from 0.05 s, and
 * some seconds where there is no board.
 *
 * @param columns, rows inner corners, 3 to 100 each
 * @param corners room for 2 · columns · rows: x, y of each, row by row; pixel (0, 0) covers
 *        0 … 1. As they were, unless 0 is returned.
 * @return 0; -ENODATA (no such board in the picture, or not all of it), -EINVAL (sizes that
 *         do not fit), -EBADMSG (a JPEG that cannot be decoded), -ENOENT (the module is not
 *         installed), -ENOEXEC (it is broken, or lacks a library), -ENOMEM, -EIO (OpenCV
 *         failed)
 */
INCISE_API int incise_board_find(const struct incise_camera_frame *frame, int columns,
				 int rows, double *corners, struct incise_error *err);

INCISE_END_DECLS
#endif
