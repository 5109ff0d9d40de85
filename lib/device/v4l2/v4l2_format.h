/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The format of a camera's frames: pixels, size, rows, rate. The nearest to rig.conf that
 * the driver offers is set, then the driver's answer is checked.
 */
#ifndef INCISE_V4L2_FORMAT_H
#define INCISE_V4L2_FORMAT_H

#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>

#define V4L2_SIDE_MAX 16384 /* pixels of a side */

struct v4l2_shape {
	enum incise_pixels pixels;
	uint32_t fourcc;
	int width, height;
	int stride;	/* bytes from row to row; 0: MJPEG */
	size_t least;	/* bytes of a whole frame */
	double rate_hz; /* 0: not known */
	double age_ms;	/* largest age of a timestamp; 0: by exposure and rate */
};

/*
 * Set the camera. 0; -EINVAL (@setup), -EOPNOTSUPP (it has no such pixels; the message
 * names those it has), -EBUSY, -EPROTO (impossible answers of the driver), -ENODEV, -EIO.
 * @where starts the message.
 */
int v4l2_format_set(int fd, const struct incise_camera_setup *setup, const char *where,
		    struct v4l2_shape *shape, struct incise_error *err);

/* "YUYV MJPG UYVY": formats of the driver, usable ones first, as far as they fit. */
void v4l2_format_list(int fd, char *text, size_t size);

#endif
