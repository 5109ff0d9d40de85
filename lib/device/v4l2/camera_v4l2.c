// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a camera of the kernel, "v4l2:/dev/v4l/by-id/…". All it does is in
 * v4l2_camera.h.
 */
#include <incise/backend.h>
#include "v4l2_camera.h"

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "camera",
	.name = "v4l2",
	.open = v4l2_camera_open,
	.scan = v4l2_camera_scan,
};
