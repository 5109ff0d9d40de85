/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A camera's controls, locked: automatic adjustment would move edges and colours from frame to
 * frame, and with the exposure the time of a frame.
 *
 *   exposure, dynamic frame rate, white balance, gain, focus:
 *   automatic off ─▶ set ─▶ read back ─▶ read again while it runs
 */
#ifndef INCISE_V4L2_CONTROLS_H
#define INCISE_V4L2_CONTROLS_H

#include <stdint.h>
#include <incise/camera.h>

#define V4L2_LOCKS_MAX 16

struct v4l2_lock {
	uint32_t id;
	int32_t value;
	const char *name; /* for people */
};

struct v4l2_controls {
	int fd;
	int n;
	int unread; /* failed checks in a row */
	struct v4l2_lock lock[V4L2_LOCKS_MAX];
	int64_t exposure_ns; /* 0: not known */
};

/*
 * Lock all controls of the camera, at the values of @setup, or as they are. @rate_hz of the
 * frames, 0: not known. 0; -EINVAL, -ERANGE (@setup), -EOPNOTSUPP (the camera lacks a control
 * that @setup sets), -EIO (it does not hold), -EBUSY, -ENODEV. @where starts the message.
 */
int v4l2_controls_lock(struct v4l2_controls *controls, int fd,
		       const struct incise_camera_setup *setup, double rate_hz,
		       const char *where, struct incise_error *err);

/* 0; -EIO: one has drifted, or cannot be read; -ENODEV: unplugged. */
int v4l2_controls_check(struct v4l2_controls *controls, const char *where,
			struct incise_error *err);

#endif
