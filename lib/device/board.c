// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Finding a board, which is in a module of its own, as vision is; see incise/board.h.
 *
 * The module is not unloaded: OpenCV leaves in threads that used it what runs when they end.
 */
#include <errno.h>
#include <incise/board.h>
#include "backends.h"
#include "module.h"

#define KIND "board"
#define NAME "opencv"

int incise_board_find(const struct incise_camera_frame *frame, int columns, int rows,
		      double *corners, struct incise_error *err)
{
	struct incise_backend_request request = {.arguments = "", .where = KIND};
	struct incise_loaded loaded;
	struct incise_board *board;
	int rc = incise_backend_find(&loaded, KIND, NAME, KIND, err);

	if (rc == -ENODEV)
		return incise_module_absent(KIND "_" NAME ".so", KIND,
					    "libopencv-calib3d-dev is", err);
	if (rc)
		return rc;
	board = loaded.backend->open(&request, err);
	if (!board)
		return -errno;
	rc = board->ops->find(board, frame, columns, rows, corners, err);
	board->ops->close(board);
	return rc;
}
