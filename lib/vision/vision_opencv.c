// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of vision on OpenCV. All it does is behind vision_opencv.h.
 */
#include "vision_opencv.h"

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "vision",
	.name = "opencv",
	.open = vision_opencv_open,
};
