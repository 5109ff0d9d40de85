// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth measurement and board detection in camera frames; see incise/vision.h and
 * incise/board.h. Each is a module of its own, so that only a program that uses it maps
 * OpenCV.
 *
 * The modules are not unloaded: OpenCV leaves destructors in the threads that used it.
 */
#include <errno.h>
#include <stdio.h>
#include <incise/board.h>
#include "backends.h"
#include "../base/module.h"

/* Open the module @kind through its backend: NULL with errno. */
static void *open_module(const char *kind, const struct incise_vision_setup *setup,
			 struct incise_error *err)
{
	struct incise_backend_request request = {
		.arguments = "",
		.where = kind,
		.vision = setup,
	};
	struct incise_loaded loaded;
	char file[40];
	int rc = incise_backend_find(&loaded, kind, "opencv", kind, err);

	if (!rc)
		return loaded.backend->open(&request, err);
	snprintf(file, sizeof(file), "%s_opencv.so", kind);
	if (rc == -ENODEV)
		rc = incise_module_absent(file, kind, err);
	errno = -rc;
	return NULL;
}

struct incise_vision *incise_vision_new(const struct incise_vision_setup *setup,
					struct incise_error *err)
{
	return open_module("vision", setup, err);
}

void incise_vision_free(struct incise_vision *vision)
{
	if (vision)
		vision->ops->close(vision);
}

int incise_vision_measure(struct incise_vision *vision,
			  const struct incise_camera_frame *frame,
			  struct incise_vision_result *result)
{
	return vision->ops->measure(vision, frame, result);
}

int incise_vision_learn(const struct incise_camera_frame *frame,
			const struct incise_vision_box *box,
			struct incise_vision_setup *setup, struct incise_error *err)
{
	/* It need not be valid before it is learnt. */
	static const struct incise_vision_setup any;
	struct incise_vision *vision = incise_vision_new(&any, err);
	int rc;

	if (!vision)
		return -errno;
	rc = vision->ops->learn(vision, frame, box, setup, err);
	vision->ops->close(vision);
	return rc;
}

int incise_board_find(const struct incise_camera_frame *frame, int columns, int rows,
		      double *corners, struct incise_error *err)
{
	struct incise_board *board = open_module("board", NULL, err);
	int rc;

	if (!board)
		return -errno;
	rc = board->ops->find(board, frame, columns, rows, corners, err);
	board->ops->close(board);
	return rc;
}
