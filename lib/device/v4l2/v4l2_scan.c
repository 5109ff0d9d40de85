// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which cameras are attached; see v4l2_camera.h. Each is named by a path that stays when it
 * is plugged elsewhere (by-id), or that is at least its socket's (by-path); /dev/video0 is
 * the order of plugging.
 */
#include <errno.h>
#include <glob.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <linux/videodev2.h>
#include "../stable_path.h"
#include "v4l2_camera.h"
#include "v4l2_file.h"
#include "v4l2_format.h"

struct search {
	const char *dev; /* the folder */
	incise_scan_found *found;
	void *context;
	bool denied;
	int n;	    /* that were told of */
	int answer; /* of @found, the last one's */
};

/* One of @folder's links to @path. */
static bool link_in(const char *dev, const char *folder, const char *path, char *link,
		    size_t size)
{
	char pattern[PATH_MAX];

	snprintf(pattern, sizeof(pattern), "%s/v4l/%s/*", dev, folder);
	return incise_stable_path(pattern, path, link, size);
}

static void describe(const struct search *s, int fd, const char *path,
		     const struct v4l2_identity *identity,
		     struct incise_scan_device *device)
{
	char stable[sizeof(device->device) - 5], formats[60];

	if (!link_in(s->dev, "by-id", path, stable, sizeof(stable)) &&
	    !link_in(s->dev, "by-path", path, stable, sizeof(stable)))
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

/* Tell of the camera at @path. 0, or why it cannot be. */
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
		describe(s, fd, path, &identity, &device);
	close(fd);
	if (rc)
		return rc;
	s->n++;
	s->answer = s->found(s->context, &device);
	return 0;
}

/* One that cannot be opened does not hide the others. */
static void look_at_all(struct search *s)
{
	char pattern[PATH_MAX];
	glob_t files;

	snprintf(pattern, sizeof(pattern), "%s/video[0-9]*", s->dev);
	if (glob(pattern, 0, NULL, &files))
		return;
	for (size_t i = 0; i < files.gl_pathc && !s->answer; i++)
		look_at(s, files.gl_pathv[i]);
	globfree(&files);
}

int v4l2_camera_scan_in(const char *dev, const char *arguments, incise_scan_found *found,
			void *context, struct incise_error *err)
{
	struct search s = {.dev = dev, .found = found, .context = context};
	int rc = 0;

	if (*arguments)
		rc = look_at(&s, arguments);
	else
		look_at_all(&s);
	if (s.denied && !s.n)
		return incise_error_set(err, EACCES,
					"v4l2: cameras may not be opened; become a "
					"member of the group that owns %s/video*",
					dev);
	/* What is not there, or is no camera, was not found. */
	if (rc && rc != -ENOENT && rc != -ENOTTY && rc != -ENXIO && rc != -ENODEV)
		return incise_error_set(err, -rc, "v4l2: %.100s: %s", arguments,
					strerror(-rc));
	return s.answer;
}

int v4l2_camera_scan(const char *arguments, incise_scan_found *found, void *context,
		     struct incise_error *err)
{
	return v4l2_camera_scan_in("/dev", arguments, found, context, err);
}
