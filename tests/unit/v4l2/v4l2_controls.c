// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2/v4l2_controls.c on a driver that the test plays: what a camera adjusts by
 * itself is off and stays so, values are what was asked for or what they were, and all that
 * does not hold is refused.
 */
#include "../unit.h"
#include "../../../lib/device/v4l2/v4l2_controls.h"
#include "driver.h"

#define WHERE "rig.conf:1: camera"

static struct v4l2_controls controls;
static struct incise_error err;

static int lock(const struct incise_camera_setup *setup)
{
	err = (struct incise_error){0};
	return v4l2_controls_lock(&controls, DRIVER_FD, setup, 30, WHERE, &err);
}

static int32_t value(uint32_t id)
{
	return driver_control(id)->value;
}

/* A webcam that adjusts everything. */
static void webcam(void)
{
	driver_reset();
	driver_add(V4L2_CID_EXPOSURE_AUTO, 0, 3, V4L2_EXPOSURE_APERTURE_PRIORITY);
	driver_add(V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, 1, 1);
	driver_add(V4L2_CID_EXPOSURE_ABSOLUTE, 3, 2047, 156);
	driver_add(V4L2_CID_AUTO_WHITE_BALANCE, 0, 1, 1);
	driver_add(V4L2_CID_WHITE_BALANCE_TEMPERATURE, 2000, 6500, 4000)->step = 10;
	driver_add(V4L2_CID_AUTOGAIN, 0, 1, 1);
	driver_add(V4L2_CID_GAIN, 0, 255, 33);
	driver_add(V4L2_CID_FOCUS_AUTO, 0, 1, 1);
	driver_add(V4L2_CID_FOCUS_ABSOLUTE, 0, 250, 20)->step = 5;
}

static void nothing_is_adjusted(void)
{
	assert_int_equal(value(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
	assert_int_equal(value(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
	assert_int_equal(value(V4L2_CID_AUTO_WHITE_BALANCE), 0);
	assert_int_equal(value(V4L2_CID_AUTOGAIN), 0);
	assert_int_equal(value(V4L2_CID_FOCUS_AUTO), 0);
}

TEST(what_was_asked_for_is_set)
{
	struct incise_camera_setup setup = {
		.exposure_ms = 8, .gain = 40, .white_balance_K = 5004, .focus = 33};

	webcam();
	assert_int_equal(lock(&setup), 0);
	nothing_is_adjusted();
	assert_int_equal(value(V4L2_CID_EXPOSURE_ABSOLUTE), 80);
	assert_int_equal(value(V4L2_CID_GAIN), 40);
	/* The nearest step. */
	assert_int_equal(value(V4L2_CID_WHITE_BALANCE_TEMPERATURE), 5000);
	assert_int_equal(value(V4L2_CID_FOCUS_ABSOLUTE), 35);
	assert_true(controls.exposure_ns == 8000000);
	assert_int_equal(controls.n, 9);
	assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
}

TEST(what_was_not_asked_for_stays)
{
	struct incise_camera_setup setup = {0};

	webcam();
	assert_int_equal(lock(&setup), 0);
	nothing_is_adjusted();
	assert_int_equal(value(V4L2_CID_EXPOSURE_ABSOLUTE), 156);
	assert_int_equal(value(V4L2_CID_GAIN), 33);
	assert_int_equal(value(V4L2_CID_WHITE_BALANCE_TEMPERATURE), 4000);
	assert_int_equal(value(V4L2_CID_FOCUS_ABSOLUTE), 20);
	assert_true(controls.exposure_ns == 15600000);
}

TEST(a_camera_without_controls_is_one_too)
{
	struct incise_camera_setup setup = {0};

	driver_reset();
	assert_int_equal(lock(&setup), 0);
	assert_int_equal(controls.n, 0);
	assert_true(controls.exposure_ns == 0);
	assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
	/* Those that cannot be used are as if they were not there. */
	driver_add(V4L2_CID_GAIN, 0, 255, 3)->flags = V4L2_CTRL_FLAG_DISABLED;
	driver_add(V4L2_CID_FOCUS_ABSOLUTE, 0, 255, 3)->flags = V4L2_CTRL_FLAG_WRITE_ONLY;
	driver_add(V4L2_CID_RED_BALANCE, 0, 255, 3)->flags = V4L2_CTRL_FLAG_READ_ONLY;
	assert_int_equal(lock(&setup), 0);
	assert_int_equal(controls.n, 0);
}

TEST(the_iris_may_stay_automatic)
{
	struct incise_camera_setup setup = {0};

	driver_reset();
	driver_add(V4L2_CID_EXPOSURE_AUTO, 2, 3, 3);
	assert_int_equal(lock(&setup), 0);
	assert_int_equal(value(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_SHUTTER_PRIORITY);
}

/* Ways in which a camera does not obey its settings. */
static void gain_stuck(void)
{
	driver_control(V4L2_CID_GAIN)->stuck = true;
	driver_control(V4L2_CID_GAIN)->held = 34;
}

static void auto_stuck(void)
{
	driver_control(V4L2_CID_AUTO_WHITE_BALANCE)->stuck = true;
	driver_control(V4L2_CID_AUTO_WHITE_BALANCE)->held = 1;
}

static void gain_busy(void)
{
	driver_control(V4L2_CID_GAIN)->error = EBUSY;
	driver_control(V4L2_CID_GAIN)->value = 77;
}

static void auto_refused(void)
{
	driver_control(V4L2_CID_AUTOGAIN)->error = EINVAL;
}

static void read_fails(void)
{
	driver.g_ctrl_error = EPIPE;
}

static void pulled(void)
{
	driver.g_ctrl_error = ENODEV;
}

static void no_gain(void)
{
	driver_control(V4L2_CID_GAIN)->id = 1;
}

static void gain_read_only(void)
{
	driver_control(V4L2_CID_GAIN)->flags = V4L2_CTRL_FLAG_READ_ONLY;
}

static void nothing(void)
{
}

TEST(what_does_not_hold_is_refused)
{
	static const struct {
		void (*make)(void);
		struct incise_camera_setup setup;
		int code;
		const char *says;
	} cases[] = {
		{gain_stuck, {.gain = 40}, EIO, "40 to 34"},
		{auto_stuck, {0}, EIO, "automatic white balance"},
		{gain_busy, {.gain = 40}, EBUSY, "gain"},
		{auto_refused, {0}, EIO, "automatic gain"},
		{read_fails, {0}, EIO, NULL},
		{pulled, {0}, ENODEV, "unplugged"},
		{no_gain, {.gain = 3}, EOPNOTSUPP, "gain"},
		{gain_read_only, {.gain = 3}, EOPNOTSUPP, "camera_setup.gain"},
		{nothing, {.gain = 256}, ERANGE, "256"},
		{nothing, {.exposure_ms = 0.1}, ERANGE, "204.7"},
		{nothing, {.exposure_ms = 34}, ERANGE, "33.3333 ms"},
		{nothing, {.focus = -1}, EINVAL, "focus"},
		{nothing, {.white_balance_K = __builtin_nan("")}, EINVAL, "nan"},
		{nothing, {.gain = 1e300}, EINVAL, "1e+300"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {

		webcam();
		cases[i].make();
		assert_error(lock(&cases[i].setup), cases[i].code, &err, cases[i].says);
	}
}

TEST(ranges_that_cannot_be_do_no_harm)
{
	struct incise_camera_setup setup = {.gain = 7};

	driver_reset();
	*driver_add(V4L2_CID_GAIN, 0, 0, 0) = (struct driver_control){
		.id = V4L2_CID_GAIN, .min = INT32_MIN, .max = INT32_MAX, .step = 0};
	assert_int_equal(lock(&setup), 0);
	assert_int_equal(value(V4L2_CID_GAIN), 7);
	*driver_control(V4L2_CID_GAIN) = (struct driver_control){
		.id = V4L2_CID_GAIN, .min = 10, .max = -10, .step = INT32_MIN};
	assert_int_equal(lock(&setup), -ERANGE);
	/* A step beyond the range leaves just its end. */
	*driver_control(V4L2_CID_GAIN) = (struct driver_control){
		.id = V4L2_CID_GAIN, .min = 0, .max = 9, .step = 10, .value = 3};
	assert_int_equal(lock(&setup), 0);
	assert_int_equal(value(V4L2_CID_GAIN), 0);
}

TEST(drift_is_found)
{
	struct incise_camera_setup setup = {.gain = 40};

	webcam();
	assert_int_equal(lock(&setup), 0);
	driver_control(V4L2_CID_GAIN)->value = 41;
	assert_error(v4l2_controls_check(&controls, WHERE, &err), EIO, &err, "gain", "40",
		     "41");
	driver_control(V4L2_CID_GAIN)->value = 40;
	driver_control(V4L2_CID_EXPOSURE_AUTO)->value = 3;
	assert_error(v4l2_controls_check(&controls, WHERE, &err), EIO, &err,
		     "automatic exposure", "1", "3");
}

TEST(one_failed_reading_is_no_drift)
{
	struct incise_camera_setup setup = {0};

	webcam();
	assert_int_equal(lock(&setup), 0);
	for (int i = 0; i < 3; i++) {
		driver.g_ctrl_error = ETIMEDOUT;
		assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
		assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
		driver.g_ctrl_error = 0;
		assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
	}
	driver.g_ctrl_error = ETIMEDOUT;
	assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
	assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), 0);
	assert_error(v4l2_controls_check(&controls, WHERE, &err), EIO, &err, NULL);
	driver.g_ctrl_error = ENODEV;
	assert_int_equal(v4l2_controls_check(&controls, WHERE, &err), -ENODEV);
}
