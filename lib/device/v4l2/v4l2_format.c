// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Choice of a camera's format, size and rate; see v4l2_format.h. Lists of a driver are
 * read up to a limit, and its numbers are checked before use.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/videodev2.h>
#include "v4l2_file.h"
#include "v4l2_format.h"

#define FORMATS_MAX 64
#define CHOICES_MAX 256		    /* sizes, or rates */
#define FRAME_MAX ((size_t)1 << 28) /* bytes */

static const struct {
	enum incise_pixels pixels;
	uint32_t fourcc;
	int bytes; /* per pixel; 0: compressed */
} known[] = {
	{INCISE_PIXELS_YUYV, V4L2_PIX_FMT_YUYV, 2},
	{INCISE_PIXELS_GREY, V4L2_PIX_FMT_GREY, 1},
	{INCISE_PIXELS_RGB, V4L2_PIX_FMT_RGB24, 3},
	{INCISE_PIXELS_MJPEG, V4L2_PIX_FMT_MJPEG, 0},
	{INCISE_PIXELS_MJPEG, V4L2_PIX_FMT_JPEG, 0},
};

#define KNOWN (sizeof(known) / sizeof(*known))

/* Format number @i of the driver; 0: no such format. */
static uint32_t offered(int fd, uint32_t i)
{
	struct v4l2_fmtdesc reported = {.index = i, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE};

	return i < FORMATS_MAX && !v4l2_ask(fd, VIDIOC_ENUM_FMT, &reported)
		       ? reported.pixelformat
		       : 0;
}

static bool is_known(uint32_t fourcc)
{
	size_t k = 0;

	while (k < KNOWN && known[k].fourcc != fourcc)
		k++;
	return k < KNOWN;
}

void v4l2_format_list(int fd, char *text, size_t size)
{
	size_t length = 0;
	char letters[5];
	uint32_t fourcc;

	*text = '\0';
	/* Usable ones first. */
	for (int other = 0; other < 2; other++)
		for (uint32_t i = 0; (fourcc = offered(fd, i)) && length + 6 < size; i++)
			if (is_known(fourcc) != other)
				length += (size_t)snprintf(text + length, size - length,
							   "%s%s", length ? " " : "",
							   v4l2_letters(fourcc, letters));
}

/* Index into known; KNOWN: the camera has no such pixels. */
static size_t find_v4l2_format(int fd, enum incise_pixels pixels)
{
	size_t best = KNOWN;
	uint32_t fourcc;

	for (uint32_t i = 0; (fourcc = offered(fd, i)); i++)
		for (size_t k = 0; k < KNOWN; k++)
			if (known[k].fourcc == fourcc && known[k].pixels == pixels &&
			    k < best)
				best = k;
	return best;
}

static long away(uint32_t a, int b)
{
	return labs((long)a - b);
}

/* The nearest step between @least and @most. */
static int step_to(int asked, uint32_t least, uint32_t most, uint32_t step)
{
	if (most < least || most > V4L2_SIDE_MAX)
		return asked;
	if (!step)
		step = 1;
	if ((uint32_t)asked <= least)
		return (int)least;
	if ((uint32_t)asked >= most)
		return (int)most;
	return (int)(least + ((uint32_t)asked - least + step / 2) / step * step);
}

/* Change a size to the nearest one of the driver, if it enumerates any. */
static void nearest_size(int fd, uint32_t fourcc, int *width, int *height)
{
	int w = *width, h = *height;
	long best = -1;

	for (uint32_t i = 0; i < CHOICES_MAX; i++) {
		struct v4l2_frmsizeenum reported = {.index = i, .pixel_format = fourcc};
		long off;

		if (v4l2_ask(fd, VIDIOC_ENUM_FRAMESIZES, &reported))
			return;
		if (reported.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
			*width = step_to(w, reported.stepwise.min_width,
					 reported.stepwise.max_width,
					 reported.stepwise.step_width);
			*height = step_to(h, reported.stepwise.min_height,
					  reported.stepwise.max_height,
					  reported.stepwise.step_height);
			return;
		}
		off = away(reported.discrete.width, w) +
		      away(reported.discrete.height, h);
		if (reported.discrete.width - 1 < V4L2_SIDE_MAX &&
		    reported.discrete.height - 1 < V4L2_SIDE_MAX &&
		    (best < 0 || off < best)) {
			best = off;
			*width = (int)reported.discrete.width;
			*height = (int)reported.discrete.height;
		}
	}
}

/* Frames per second; 0: not a rate. */
static double rate_of(const struct v4l2_fract *interval)
{
	double hz = interval->numerator
			    ? (double)interval->denominator / interval->numerator
			    : 0;

	return hz >= 1e-3 && hz <= 1e5 ? hz : 0;
}

static struct v4l2_fract nearest_interval(int fd, const struct v4l2_shape *shape,
					  double hz)
{
	struct v4l2_fract best = {1000, (uint32_t)lround(hz * 1000)};
	double off = -1;

	for (uint32_t i = 0; i < CHOICES_MAX; i++) {
		struct v4l2_frmivalenum reported = {.index = i,
						    .pixel_format = shape->fourcc,
						    .width = (uint32_t)shape->width,
						    .height = (uint32_t)shape->height};
		double is;

		if (v4l2_ask(fd, VIDIOC_ENUM_FRAMEINTERVALS, &reported))
			break;
		if (reported.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
			/* The shortest interval is the highest rate. */
			if (rate_of(&reported.stepwise.min) > 0 &&
			    hz > rate_of(&reported.stepwise.min))
				return reported.stepwise.min;
			if (rate_of(&reported.stepwise.max) > 0 &&
			    hz < rate_of(&reported.stepwise.max))
				return reported.stepwise.max;
			break;
		}
		is = rate_of(&reported.discrete);
		if (is > 0 && (off < 0 || fabs(is - hz) < off)) {
			off = fabs(is - hz);
			best = reported.discrete;
		}
	}
	return best;
}

/* The rate stays 0 if the driver has no rate. */
static void set_rate(int fd, struct v4l2_shape *shape, double hz)
{
	struct v4l2_streamparm reported = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};

	if (v4l2_ask(fd, VIDIOC_G_PARM, &reported))
		return;
	if (hz > 0 && reported.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) {
		struct v4l2_streamparm asked = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};

		asked.parm.capture.timeperframe = nearest_interval(fd, shape, hz);
		v4l2_ask(fd, VIDIOC_S_PARM, &asked);
		if (v4l2_ask(fd, VIDIOC_G_PARM, &reported))
			return;
	}
	shape->rate_hz = rate_of(&reported.parm.capture.timeperframe);
}

/* Check the answer of the driver; NULL, or the reason why it is impossible. */
static const char *wrong(const struct v4l2_pix_format *reported, size_t kind,
			 struct v4l2_shape *shape)
{
	size_t row;

	if (reported->pixelformat != known[kind].fourcc)
		return "other pixels than were set";
	if (reported->field != V4L2_FIELD_NONE)
		return "interlaced frames, whose halves have two times; set a "
		       "progressive mode";
	if (reported->width - 1 >= V4L2_SIDE_MAX || reported->height - 1 >= V4L2_SIDE_MAX)
		return "an invalid size";
	if (!reported->sizeimage || reported->sizeimage > FRAME_MAX)
		return "an invalid number of bytes";
	*shape = (struct v4l2_shape){
		.pixels = known[kind].pixels,
		.fourcc = reported->pixelformat,
		.width = (int)reported->width,
		.height = (int)reported->height,
	};
	if (!known[kind].bytes)
		return NULL;
	row = (size_t)reported->width * (size_t)known[kind].bytes;
	/* Old drivers leave it at 0 where rows have no padding. */
	shape->stride = (int)(reported->bytesperline ? reported->bytesperline : row);
	if (reported->bytesperline > FRAME_MAX || (size_t)shape->stride < row)
		return "rows that are too short";
	if (shape->pixels == INCISE_PIXELS_YUYV && reported->width % 2)
		return "an odd number of pixels in a row of YUYV";
	/* Padding behind the last row may be missing. */
	shape->least = (size_t)shape->stride * (reported->height - 1) + row;
	return shape->least > reported->sizeimage ? "fewer bytes than its rows have"
						  : NULL;
}

static int check_v4l2_format_setup(const struct incise_camera_setup *setup,
				   const char *where, struct incise_error *err)
{
	if (setup->width < 0 || setup->width > V4L2_SIDE_MAX || setup->height < 0 ||
	    setup->height > V4L2_SIDE_MAX)
		return incise_error_set(
			err, EINVAL,
			"%s: camera_setup: invalid frame size %d x %d pixels; correct "
			"width and height",
			where, setup->width, setup->height);
	if (!(setup->rate_hz >= 0 && setup->rate_hz <= 10000))
		return incise_error_set(
			err, EINVAL,
			"%s: camera_setup: invalid rate of %g frames/s; correct rate_hz",
			where, setup->rate_hz);
	return 0;
}

int v4l2_format_set(int fd, const struct incise_camera_setup *setup, const char *where,
		    struct v4l2_shape *shape, struct incise_error *err)
{
	struct v4l2_format set = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
	struct v4l2_format reported = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
	size_t kind = find_v4l2_format(fd, setup->pixels);
	int width, height, rc;
	const char *why;
	char list[120];

	rc = check_v4l2_format_setup(setup, where, err);
	if (rc)
		return rc;
	rc = v4l2_ask(fd, VIDIOC_G_FMT, &set);
	if (rc)
		return incise_error_set(err, -rc, "%s: the camera reports no format: %s",
					where, strerror(-rc));
	if (kind == KNOWN) {
		v4l2_format_list(fd, list, sizeof(list));
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: the camera does not support camera_setup.format; it has "
			"%s; set a format that both have: yuyv, grey, mjpeg or rgb",
			where, *list ? list : "none");
	}
	width = setup->width ? setup->width
			     : step_to(V4L2_SIDE_MAX, 1, set.fmt.pix.width, 1);
	height = setup->height ? setup->height
			       : step_to(V4L2_SIDE_MAX, 1, set.fmt.pix.height, 1);
	nearest_size(fd, known[kind].fourcc, &width, &height);
	set.fmt.pix.width = (uint32_t)width;
	set.fmt.pix.height = (uint32_t)height;
	set.fmt.pix.pixelformat = known[kind].fourcc;
	set.fmt.pix.field = V4L2_FIELD_NONE;
	set.fmt.pix.bytesperline = set.fmt.pix.sizeimage = 0;
	rc = v4l2_ask(fd, VIDIOC_S_FMT, &set);
	if (!rc)
		rc = v4l2_ask(fd, VIDIOC_G_FMT, &reported);
	if (rc)
		return incise_error_set(err, -rc,
					rc == -EBUSY ? "%s: another program uses the "
						       "camera; end it: %s"
						     : "%s: the camera's format cannot "
						       "be set: %s",
					where, strerror(-rc));
	why = wrong(&reported.fmt.pix, kind, shape);
	if (why)
		return incise_error_set(err, EPROTO, "%s: the camera's driver sends %s",
					where, why);
	set_rate(fd, shape, setup->rate_hz);
	return 0;
}
