// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The entry of the vision module on OpenCV.
 */
#include "vision_opencv.h"

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "vision",
	.name = "opencv",
	.open = vision_opencv_open,
};
