/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a camera's pictures are: pixels, size, rows, rate. Chosen among those that the
 * driver offers, the nearest to what rig.conf asks for, and then as the driver says that
 * it is.
 */
#ifndef INCISE_V4L2_FORMAT_H
#define INCISE_V4L2_FORMAT_H

#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>

#define V4L2_SIDE_MOST 16384 /* pixels of a side */

struct v4l2_shape {
	enum incise_pixels pixels;
	uint32_t fourcc;
	int width, height;
	int stride;	/* bytes from row to row; 0: MJPEG */
	size_t least;	/* bytes that a whole picture has */
	double rate_hz; /* 0: not known */
};

/*
 * Set the camera. 0; -EINVAL (@setup), -EOPNOTSUPP (it has no such pixels; the line names
 * those it has), -EBUSY (another program has it), -EPROTO (what the driver says cannot
 * be), -ENODEV, -EIO. @where begins the message.
 */
int v4l2_format_set(int fd, const struct incise_camera_setup *setup, const char *where,
		    struct v4l2_shape *shape, struct incise_error *err);

/* "YUYV MJPG UYVY": the formats that a driver offers, as far as they fit; ours first. */
void v4l2_format_list(int fd, char *text, size_t size);

#endif
