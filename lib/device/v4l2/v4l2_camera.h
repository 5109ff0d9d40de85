/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A camera of the kernel, "v4l2:/dev/v4l/by-id/…": format, controls and stream put together
 * behind the door of cameras, with a thread that takes the pictures.
 */
#ifndef INCISE_V4L2_CAMERA_H
#define INCISE_V4L2_CAMERA_H

#include <incise/backend.h>

/* .open and .scan of struct incise_backend. */
void *v4l2_camera_open(const struct incise_backend_request *request,
		       struct incise_error *err);
int v4l2_camera_scan(const char *arguments, incise_scan_found *found, void *context,
		     struct incise_error *err);

/* The same below another folder than /dev, for tests. */
int v4l2_camera_scan_in(const char *dev, const char *arguments, incise_scan_found *found,
			void *context, struct incise_error *err);

#endif
