// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2/v4l2_format.c on a driver that the test plays: the nearest on offer is
 * taken, what is given is reported, and what cannot be is refused.
 */
#include "../unit.h"
#include "../../../lib/device/v4l2/v4l2_format.h"
#include "driver.h"

#define WHERE "rig.conf:1: camera"

static struct v4l2_shape shape;
static struct incise_error err;

static int set(const struct incise_camera_setup *setup)
{
	err = (struct incise_error){0};
	shape = (struct v4l2_shape){0};
	return v4l2_format_set(DRIVER_FD, setup, WHERE, &shape, &err);
}

TEST(the_nearest_is_taken)
{
	static const struct {
		bool stepwise;
		int width, height;
		double rate_hz;
		int is_width, is_height;
		double is_hz;
	} cases[] = {
		{false, 0, 0, 0, 16, 8, 30}, /* as it is */
		{false, 32, 24, 60, 32, 24, 60},
		{false, 30, 20, 59.94, 32, 24, 60},
		{false, 10000, 10000, 1000, 64, 32, 60},
		{false, 1, 1, 0.5, 16, 8, 30},
		{false, 64, 0, 0, 64, 32, 30}, /* 64 x 8 is not on offer */
		{true, 21, 13, 25, 24, 16, 25},
		{true, 19, 11, 29.97, 16, 8, 29.97},
		{true, 1000, 1, 1000, 64, 8, 100},
		{true, 64, 32, 1, 64, 32, 5},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_camera_setup setup = {.width = cases[i].width,
						    .height = cases[i].height,
						    .rate_hz = cases[i].rate_hz,
						    .pixels = INCISE_PIXELS_YUYV};

		driver_reset();
		driver.stepwise = cases[i].stepwise;
		if (set(&setup))
			fail_msg("case %zu: %s", i, err.text);
		/* A thousandth of a Hz is what it is asked in. */
		if (shape.width != cases[i].is_width ||
		    shape.height != cases[i].is_height ||
		    fabs(shape.rate_hz - cases[i].is_hz) > 1e-3)
			fail_msg("case %zu: %d x %d, %g Hz", i, shape.width, shape.height,
				 shape.rate_hz);
		assert_int_equal(shape.stride, shape.width * 2);
		assert_int_equal(shape.least, shape.width * 2 * shape.height);
	}
}

TEST(each_kind_of_pixels_has_its_rows)
{
	static const struct {
		uint32_t fourcc;
		enum incise_pixels pixels;
		int stride;
	} cases[] = {
		{V4L2_PIX_FMT_YUYV, INCISE_PIXELS_YUYV, 32},
		{V4L2_PIX_FMT_GREY, INCISE_PIXELS_GREY, 16},
		{V4L2_PIX_FMT_RGB24, INCISE_PIXELS_RGB, 48},
		{V4L2_PIX_FMT_MJPEG, INCISE_PIXELS_MJPEG, 0},
	};

	for (size_t i = 0; i < 4; i++) {
		struct incise_camera_setup setup = {.pixels = cases[i].pixels};

		driver_reset();
		driver.format[0] = V4L2_PIX_FMT_NV12;
		driver.format[1] = V4L2_PIX_FMT_UYVY;
		driver.format[2] = cases[i].fourcc;
		assert_int_equal(set(&setup), 0);
		assert_int_equal(shape.fourcc, cases[i].fourcc);
		assert_int_equal(shape.pixels, cases[i].pixels);
		assert_int_equal(shape.stride, cases[i].stride);
		assert_int_equal(shape.least, cases[i].stride * 8);
	}
}

TEST(rows_may_be_padded)
{
	struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_YUYV};

	driver_reset();
	driver.lie.bytesperline = 64;
	driver.lie.sizeimage = 64 * 8;
	assert_int_equal(set(&setup), 0);
	assert_int_equal(shape.stride, 64);
	/* The last row's padding may be missing. */
	assert_int_equal(shape.least, 64 * 7 + 32);
}

TEST(what_cannot_be_is_refused)
{
	static const struct {
		struct v4l2_pix_format lie;
		struct incise_camera_setup setup;
		int code;
		const char *says;
	} cases[] = {
		{{.width = 100000}, {0}, EPROTO, "size"},
		{{.height = UINT32_MAX}, {0}, EPROTO, "size"},
		{{.bytesperline = 31}, {0}, EPROTO, "rows"},
		{{.bytesperline = UINT32_MAX}, {0}, EPROTO, "rows"},
		{{.sizeimage = 255}, {0}, EPROTO, "bytes"},
		{{.sizeimage = UINT32_MAX}, {0}, EPROTO, "bytes"},
		{{.width = 15}, {0}, EPROTO, "odd"},
		{{.pixelformat = V4L2_PIX_FMT_GREY}, {0}, EPROTO, "pixels"},
		{{.field = V4L2_FIELD_INTERLACED}, {0}, EPROTO, "interlaced"},
		{{0}, {.width = -1}, EINVAL, "-1 x 0"},
		{{0}, {.height = 16385}, EINVAL, "0 x 16385"},
		{{0}, {.rate_hz = -3}, EINVAL, "-3"},
		{{0}, {.rate_hz = NAN}, EINVAL, "nan"},
		{{0}, {.rate_hz = INFINITY}, EINVAL, "inf"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_camera_setup setup = cases[i].setup;

		driver_reset();
		driver.lie = cases[i].lie;
		setup.pixels = INCISE_PIXELS_YUYV;
		assert_error(set(&setup), cases[i].code, &err, cases[i].says);
	}
}

TEST(a_missing_format_names_those_there_are)
{
	struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_GREY};

	driver_reset();
	assert_int_equal(set(&setup), -EOPNOTSUPP);
	assert_says(err.text, "camera_setup.format", "YUYV MJPG");
	driver.format[0] = 0;
	assert_int_equal(set(&setup), -EOPNOTSUPP);
	assert_says(err.text, "none");
}

TEST(refusals_of_the_driver_are_reported)
{
	struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_YUYV};

	driver_reset();
	driver.s_fmt_error = EBUSY;
	assert_int_equal(set(&setup), -EBUSY);
	assert_says(err.text, "program");
	driver.s_fmt_error = EIO;
	assert_int_equal(set(&setup), -EIO);
	driver.g_fmt_error = ENODEV;
	assert_int_equal(set(&setup), -ENODEV);
}

TEST(a_rate_may_be_unknown)
{
	struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_YUYV, .rate_hz = 30};

	driver_reset();
	driver.no_parm = true;
	assert_int_equal(set(&setup), 0);
	assert_true(shape.rate_hz == 0);
	driver.no_parm = false;
	driver.interval[0] = (struct v4l2_fract){0, 30};
	driver.interval[1] = (struct v4l2_fract){UINT32_MAX, 1};
	driver.parm = driver.interval[1];
	setup.rate_hz = 0;
	assert_int_equal(set(&setup), 0);
	assert_true(shape.rate_hz == 0);
}

TEST(signals_do_not_matter)
{
	struct incise_camera_setup setup = {.pixels = INCISE_PIXELS_YUYV};

	driver_reset();
	driver.interrupted = 50;
	assert_int_equal(set(&setup), 0);
	/* Without end they do not hold it for ever. */
	driver.interrupted = 1000000;
	assert_int_equal(set(&setup), -EINTR);
}
