// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera, whatever stands behind it; see incise/camera.h.
 */
#include <stdio.h>
#include <incise/backend.h>

/* Pictures that wait are no more in any camera; who reads slowly must come to an end. */
#define WAIT_MOST 32

int incise_camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	return camera->ops->read(camera, frame);
}

int incise_camera_newest(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct incise_camera_frame next;
	int found = 0, rc = 1;

	for (int i = 0; i < WAIT_MOST && rc == 1; i++) {
		rc = incise_camera_read(camera, &next);
		if (rc == 1) {
			*frame = next;
			found = 1;
		}
	}
	/* An error is said again by the next read. */
	return found ? found : rc;
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
