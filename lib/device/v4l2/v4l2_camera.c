// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera of the kernel; see v4l2_camera.h.
 *
 *   v4l2_camera_open(): format ─▶ controls ─▶ stream ─▶ thread: step, step, check controls …
 *                                                          │ waiting
 *   incise_camera_read() ◀─────────────────────────────────┘
 *
 * When the stream ends the thread leaves the reason, and read() gives it behind the last
 * picture.
 */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <linux/videodev2.h>
#include "../../base/monotonic.h"
#include "../thread.h"
#include "v4l2_camera.h"
#include "v4l2_controls.h"
#include "v4l2_file.h"
#include "v4l2_stream.h"

#define WAIT_MS 100	      /* for a picture, and for the end at most */
#define CHECK_NS 1000000000LL /* controls, once in so long, */
#define CHECK_PICTURES 64     /* or in so many pictures */

struct v4l2_camera {
	struct incise_camera camera;
	char where[200];
	struct v4l2_identity identity;
	struct v4l2_controls controls;
	struct v4l2_stream stream;
	int fd;
	pthread_t thread;
	bool runs;
	atomic_bool stop;
	atomic_int end; /* 0, or why the stream is at its end: then cause is there */
	struct incise_error cause;
};

static const struct v4l2_camera *of(const struct incise_camera *camera)
{
	return (const struct v4l2_camera *)camera;
}

static void *thread_run(void *argument)
{
	struct v4l2_camera *c = argument;
	int64_t checked_ns = incise_monotonic_ns();
	int pictures = 0, rc = 0;

	while (rc >= 0 && !atomic_load_explicit(&c->stop, memory_order_relaxed)) {
		rc = v4l2_stream_step(&c->stream, WAIT_MS, &c->cause);
		if (rc < 0)
			break;
		pictures += rc;
		if (pictures < CHECK_PICTURES &&
		    incise_monotonic_ns() - checked_ns < CHECK_NS)
			continue;
		rc = v4l2_controls_check(&c->controls, c->where, &c->cause);
		checked_ns = incise_monotonic_ns();
		pictures = 0;
	}
	atomic_store_explicit(&c->end, rc < 0 ? rc : 0, memory_order_release);
	return NULL;
}

static int camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct v4l2_camera *c = (struct v4l2_camera *)camera;
	/* First, so that a picture before the end is not passed over. */
	int end = atomic_load_explicit(&c->end, memory_order_acquire);
	int rc = v4l2_stream_read(&c->stream, frame);

	return rc ? rc : end;
}

static void camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	const struct v4l2_camera *c = of(camera);

	*info = (struct incise_camera_info){
		.rate_hz = c->stream.shape.rate_hz,
		.width = c->stream.shape.width,
		.height = c->stream.shape.height,
		.pixels = c->stream.shape.pixels,
		.exposure_ns = c->controls.exposure_ns,
		.damaged = atomic_load_explicit(&c->stream.damaged, memory_order_relaxed),
	};
	snprintf(info->name, sizeof(info->name), "%s", c->identity.card);
}

static uint64_t camera_lost(const struct incise_camera *camera)
{
	return atomic_load_explicit(&of(camera)->stream.lost, memory_order_relaxed);
}

static int camera_cause(struct incise_camera *camera, char *text, size_t size)
{
	const struct v4l2_camera *c = of(camera);
	int end = atomic_load_explicit(&c->end, memory_order_acquire);

	return snprintf(text, size, "%s", end ? c->cause.text : "");
}

static void camera_close(struct incise_camera *camera)
{
	struct v4l2_camera *c = (struct v4l2_camera *)camera;

	if (c->runs) {
		atomic_store_explicit(&c->stop, true, memory_order_relaxed);
		pthread_join(c->thread, NULL);
	}
	v4l2_stream_stop(&c->stream);
	if (c->fd >= 0)
		close(c->fd);
	free(c);
}

static const struct incise_camera_ops ops = {
	.read = camera_read,
	.info = camera_info,
	.lost = camera_lost,
	.close = camera_close,
	.cause = camera_cause,
};

static int open_file(struct v4l2_camera *c, const char *path, struct incise_error *err)
{
	const char *todo;
	int rc = *path == '/' ? v4l2_open(path) : -EINVAL;

	if (rc >= 0) {
		c->fd = rc;
		rc = v4l2_identify(c->fd, &c->identity);
	}
	switch (rc) {
	case 0:
		break;
	case -EINVAL:
		return incise_error_set(err, EINVAL,
					"%s: expected v4l2:PATH such as "
					"v4l2:/dev/v4l/by-id/…; correct it",
					c->where);
	case -ENOENT:
	case -ENXIO:
	case -ENODEV:
		todo = "there is no such camera; plug it in, or look for its path in "
		       "/dev/v4l/by-id";
		break;
	case -EACCES:
	case -EPERM:
		todo = "not permitted; become a member of the group that owns it";
		break;
	case -EBUSY:
		todo = "another program uses it; end that one";
		break;
	case -ENOTTY:
		todo = "this is no camera; name one of /dev/v4l/by-id";
		break;
	default:
		todo = strerror(-rc);
	}
	if (rc)
		return incise_error_set(err, -rc, "%s: camera %.120s: %s", c->where, path,
					todo);
	if (!(c->identity.capabilities & V4L2_CAP_VIDEO_CAPTURE) ||
	    !(c->identity.capabilities & V4L2_CAP_STREAMING))
		return incise_error_set(err, EOPNOTSUPP,
					"%s: camera %.120s: %s gives no stream of "
					"pictures here; it may have another "
					"/dev/video… that does",
					c->where, path, c->identity.card);
	return 0;
}

static int set_up(struct v4l2_camera *c, const struct incise_backend_request *asked,
		  struct incise_error *err)
{
	static const struct incise_camera_setup plain = {.pixels = INCISE_PIXELS_YUYV};
	const struct incise_camera_setup *setup = asked->camera ? asked->camera : &plain;
	uint32_t priority = V4L2_PRIORITY_RECORD;
	struct v4l2_shape shape;
	bool real_time;
	int rc = open_file(c, asked->arguments, err);

	if (rc)
		return rc;
	/* Other programs cannot set it then. Not every driver has that. */
	v4l2_ask(c->fd, VIDIOC_S_PRIORITY, &priority);
	rc = v4l2_format_set(c->fd, setup, c->where, &shape, err);
	if (rc)
		return rc;
	rc = v4l2_controls_lock(&c->controls, c->fd, setup, shape.rate_hz, c->where, err);
	if (rc)
		return rc;
	rc = v4l2_stream_start(&c->stream, c->fd, &shape, c->controls.exposure_ns,
			       c->where, err);
	if (rc)
		return rc;
	/* Some cameras forget what they were set to when they begin. */
	rc = v4l2_controls_check(&c->controls, c->where, err);
	if (rc)
		return rc;
	rc = incise_thread_start(&c->thread, thread_run, c, &real_time);
	if (rc)
		return incise_error_set(err, -rc, "%s: cannot begin: %s", c->where,
					strerror(-rc));
	c->runs = true;
	return 0;
}

void *v4l2_camera_open(const struct incise_backend_request *asked,
		       struct incise_error *err)
{
	struct v4l2_camera *c = aligned_alloc(64, sizeof(*c));
	int rc;

	if (!c) {
		incise_error_set(err, ENOMEM, "%s: %s", asked->where, strerror(ENOMEM));
		return NULL;
	}
	memset(c, 0, sizeof(*c));
	c->camera.ops = &ops;
	c->fd = -1;
	snprintf(c->where, sizeof(c->where), "%s", asked->where);
	rc = set_up(c, asked, err);
	if (!rc)
		return &c->camera;
	camera_close(&c->camera);
	errno = -rc;
	return NULL;
}
