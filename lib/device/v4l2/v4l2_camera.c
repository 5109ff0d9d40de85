// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera of the kernel, "v4l2:/dev/v4l/by-id/…", and the search for those attached.
 *
 *   open ─▶ format ─▶ controls ─▶ stream ─▶ thread: step, step, check controls …
 *                                              │ waiting
 *   incise_camera_read() ◀─────────────────────┘
 *
 * When the stream ends, the thread keeps the reason; read() reports it after the last
 * frame.
 */
#include <errno.h>
#include <glob.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <linux/videodev2.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/stable_path.h"
#include "../../rig/thread.h"
#include "v4l2_controls.h"
#include "v4l2_file.h"
#include "v4l2_format.h"
#include "v4l2_stream.h"

#define WAIT_MS 100	      /* for a frame; close takes no longer than that */
#define CHECK_NS 1000000000LL /* between two checks of the controls, … */
#define CHECK_FRAMES 64	      /* … or so many frames, whichever is first */
#define CLOCK_NS 5000000      /* change of the age of frames that is worth a note */

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
	atomic_int end; /* 0, or the errno that ended the stream: then cause is set */
	struct incise_error cause;
};

static const struct v4l2_camera *v4l2_camera_of(const struct incise_camera *camera)
{
	return (const struct v4l2_camera *)camera;
}

static void *thread_run(void *argument)
{
	struct v4l2_camera *c = argument;
	int64_t checked_ns = incise_monotonic_ns();
	int frames = 0, rc = 0;

	while (rc >= 0 && !atomic_load_explicit(&c->stop, memory_order_relaxed)) {
		rc = v4l2_stream_step(&c->stream, WAIT_MS, &c->cause);
		if (rc < 0)
			break;
		frames += rc;
		if (frames < CHECK_FRAMES &&
		    incise_monotonic_ns() - checked_ns < CHECK_NS)
			continue;
		rc = v4l2_controls_check(&c->controls, c->where, &c->cause);
		checked_ns = incise_monotonic_ns();
		frames = 0;
	}
	atomic_store_explicit(&c->end, rc < 0 ? rc : 0, memory_order_release);
	return NULL;
}

static int camera_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct v4l2_camera *c = (struct v4l2_camera *)camera;
	/* Read first, so that no frame before the end is left out. */
	int end = atomic_load_explicit(&c->end, memory_order_acquire);
	int rc = v4l2_stream_read(&c->stream, frame);

	return rc ? rc : end;
}

static void camera_info(const struct incise_camera *camera,
			struct incise_camera_info *info)
{
	const struct v4l2_camera *c = v4l2_camera_of(camera);

	long long clock_ns =
		atomic_load_explicit(&c->stream.clock_ns, memory_order_relaxed);
	unsigned int stride =
		atomic_load_explicit(&c->stream.stride, memory_order_relaxed);

	*info = (struct incise_camera_info){
		.rate_hz = c->stream.shape.rate_hz,
		.width = c->stream.shape.width,
		.height = c->stream.shape.height,
		.pixels = c->stream.shape.pixels,
		.exposure_ns = c->controls.exposure_ns,
		.damaged = atomic_load_explicit(&c->stream.damaged, memory_order_relaxed),
		.clock_ns = clock_ns,
	};
	if (clock_ns > CLOCK_NS)
		snprintf(info->note, sizeof(info->note),
			 "the age of its frames changed by %.1f ms: its clock drifts or "
			 "was stepped, and times are uncertain by as much",
			 (double)clock_ns / 1e6);
	else if (stride > 1)
		snprintf(info->note, sizeof(info->note),
			 "its driver counts %u for each frame, which is no loss", stride);
	snprintf(info->name, sizeof(info->name), "%s", c->identity.card);
}

static uint64_t camera_lost(const struct incise_camera *camera)
{
	return atomic_load_explicit(&v4l2_camera_of(camera)->stream.lost,
				    memory_order_relaxed);
}

static int camera_cause(struct incise_camera *camera, char *text, size_t size)
{
	const struct v4l2_camera *c = v4l2_camera_of(camera);
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

static int open_v4l2_camera_file(struct v4l2_camera *c, const char *path,
				 struct incise_error *err)
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
		todo = "no such camera; plug it in, or find its path in /dev/v4l/by-id";
		break;
	case -EACCES:
	case -EPERM:
		todo = "no permission; join the group that owns it";
		break;
	case -EBUSY:
		todo = "another program uses it; end it";
		break;
	case -ENOTTY:
		todo = "not a camera; name one of /dev/v4l/by-id";
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
					"%s: camera %.120s: %s has no stream of "
					"frames; try its other /dev/video…",
					c->where, path, c->identity.card);
	return 0;
}

static int set_up_v4l2_camera(struct v4l2_camera *c,
			      const struct incise_backend_request *asked,
			      struct incise_error *err)
{
	static const struct incise_camera_setup plain = {.pixels = INCISE_PIXELS_YUYV};
	const struct incise_camera_setup *setup = asked->camera ? asked->camera : &plain;
	uint32_t priority = V4L2_PRIORITY_RECORD;
	struct v4l2_shape shape;
	bool real_time;
	int rc = open_v4l2_camera_file(c, asked->arguments, err);

	if (rc)
		return rc;
	/* Then other programs cannot change settings. Not every driver supports it. */
	v4l2_ask(c->fd, VIDIOC_S_PRIORITY, &priority);
	rc = v4l2_format_set(c->fd, setup, c->where, &shape, err);
	if (rc)
		return rc;
	shape.age_ms = setup->age_ms;
	rc = v4l2_controls_lock(&c->controls, c->fd, setup, shape.rate_hz, c->where, err);
	if (rc)
		return rc;
	rc = v4l2_stream_start(&c->stream, c->fd, &shape, c->controls.exposure_ns,
			       c->where, err);
	if (rc)
		return rc;
	/* Some cameras forget their settings when they start. */
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

static void *camera_open(const struct incise_backend_request *asked,
			 struct incise_error *err)
{
	struct v4l2_camera *c = incise_backend_alloc(sizeof(*c), asked->where, err);
	int rc;

	if (!c)
		return NULL;
	c->camera.ops = &ops;
	c->fd = -1;
	snprintf(c->where, sizeof(c->where), "%s", asked->where);
	rc = set_up_v4l2_camera(c, asked, err);
	if (!rc)
		return &c->camera;
	camera_close(&c->camera);
	errno = -rc;
	return NULL;
}

/*
 * Search. A camera is named by a path that stays when it is plugged in elsewhere (by-id),
 * or by the path of its socket (by-path); /dev/video0 depends on the order of plugging.
 */
struct search {
	incise_scan_found *found;
	void *context;
	bool denied;
	int n;	    /* reported */
	int answer; /* last return of @found */
};

static void describe_v4l2_camera(int fd, const char *path,
				 const struct v4l2_identity *identity,
				 struct incise_scan_device *device)
{
	char stable[sizeof(device->device) - 5], formats[60];

	if (!incise_stable_path("/dev/v4l/by-id/*", path, stable, sizeof(stable)) &&
	    !incise_stable_path("/dev/v4l/by-path/*", path, stable, sizeof(stable)))
		snprintf(stable, sizeof(stable), "%s", path);
	snprintf(device->device, sizeof(device->device), "v4l2:%s", stable);
	device->usable = identity->capabilities & V4L2_CAP_STREAMING;
	v4l2_format_list(fd, formats, sizeof(formats));
	snprintf(device->what, sizeof(device->what), "%.32s (%.55s)", identity->card,
		 *formats ? formats : "no formats");
	incise_scan_tell(device, "name", "%s", identity->card);
	incise_scan_tell(device, "driver", "%s", identity->driver);
	incise_scan_tell(device, "driver_version", "%u.%u.%u",
			 identity->version >> 16 & 0xff, identity->version >> 8 & 0xff,
			 identity->version & 0xff);
	incise_scan_tell(device, "bus", "%s", identity->bus);
	incise_scan_tell(device, "path", "%.99s", path);
	incise_scan_tell(device, "formats", "%s", formats);
}

/* Report the camera at @path. 0 or a negative errno. */
static int look_at(struct search *s, const char *path)
{
	struct incise_scan_device device = {0};
	struct v4l2_identity identity;
	int fd = v4l2_open(path), rc;

	if (fd < 0) {
		s->denied |= fd == -EACCES || fd == -EPERM;
		return fd;
	}
	rc = v4l2_identify(fd, &identity);
	if (!rc && !(identity.capabilities & V4L2_CAP_VIDEO_CAPTURE))
		rc = -ENOTTY;
	if (!rc)
		describe_v4l2_camera(fd, path, &identity, &device);
	close(fd);
	if (rc)
		return rc;
	s->n++;
	s->answer = s->found(s->context, &device);
	return 0;
}

/* A camera that cannot be opened is left out. */
static void look_at_all(struct search *s)
{
	glob_t files;

	if (glob("/dev/video[0-9]*", 0, NULL, &files))
		return;
	for (size_t i = 0; i < files.gl_pathc && !s->answer; i++)
		look_at(s, files.gl_pathv[i]);
	globfree(&files);
}

static int camera_scan(const char *arguments, incise_scan_found *found, void *context,
		       struct incise_error *err)
{
	struct search s = {.found = found, .context = context};
	int rc = 0;

	if (*arguments)
		rc = look_at(&s, arguments);
	else
		look_at_all(&s);
	if (s.denied && !s.n)
		return incise_error_set(err, EACCES,
					"v4l2: no permission to open cameras; join the "
					"group that owns /dev/video*");
	/* A missing device, or a device that is no camera, was not found. */
	if (rc && rc != -ENOENT && rc != -ENOTTY && rc != -ENXIO && rc != -ENODEV)
		return incise_error_set(err, -rc, "v4l2: %.100s: %s", arguments,
					strerror(-rc));
	return s.answer;
}

INCISE_BACKEND(incise_camera_v4l2, "camera", "v4l2", .open = camera_open,
	       .scan = camera_scan);
