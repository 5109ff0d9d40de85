// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera, whatever stands behind it; see incise/camera.h.
 */
#include <stdio.h>
#include <incise/backend.h>

int incise_camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	return camera->ops->read(camera, frame);
}

void incise_camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	camera->ops->info(camera, info);
}

uint64_t incise_camera_lost(const struct incise_camera *camera)
{
	return camera->ops->lost(camera);
}

int incise_camera_cause(struct incise_camera *camera, char *text, size_t size)
{
	return camera->ops->cause ? camera->ops->cause(camera, text, size)
				  : snprintf(text, size, "%s", "");
}
