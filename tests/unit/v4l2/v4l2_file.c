// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/device/v4l2/v4l2_file.c on a driver that the test plays. */
#include "../unit.h"
#include "../../../lib/device/v4l2/v4l2_file.h"
#include "driver.h"

TEST(what_a_driver_names_is_made_safe)
{
	struct v4l2_identity identity;

	driver_reset();
	assert_int_equal(v4l2_identify(DRIVER_FD, &identity), 0);
	/* Without an end, and with a line's end in it. */
	assert_int_equal(strlen(identity.card), 32);
	assert_int_equal(identity.card[1], '?');
	assert_string_equal(identity.driver, "played");
	assert_string_equal(identity.bus, "usb-1");
	/* Of the file, not of the whole device. */
	assert_int_equal(identity.capabilities, driver.capabilities);
}

TEST(letters_are_printable)
{
	char text[5];

	assert_string_equal(v4l2_letters(V4L2_PIX_FMT_YUYV, text), "YUYV");
	assert_string_equal(v4l2_letters(V4L2_PIX_FMT_Y16_BE, text), "Y16 ");
	assert_string_equal(v4l2_letters(0x000a41ff, text), "?A??");
}

TEST(signals_are_outlived)
{
	struct v4l2_capability reported;

	driver_reset();
	driver.interrupted = 5;
	assert_int_equal(v4l2_open("/dev/video0"), DRIVER_FD);
	driver.interrupted = 5;
	assert_int_equal(v4l2_ask(DRIVER_FD, VIDIOC_QUERYCAP, &reported), 0);
	driver.interrupted = 1 << 20;
	assert_int_equal(v4l2_ask(DRIVER_FD, VIDIOC_QUERYCAP, &reported), -EINTR);
	driver.interrupted = 1 << 20;
	assert_int_equal(v4l2_open("/dev/video0"), -EINTR);
}

TEST(errors_come_as_they_are)
{
	struct v4l2_identity identity;

	driver_reset();
	driver.open_error = EACCES;
	assert_int_equal(v4l2_open("/dev/video0"), -EACCES);
	driver.querycap_error = ENODEV;
	assert_int_equal(v4l2_identify(DRIVER_FD, &identity), -ENODEV);
	/* Other devices answer so. */
	driver.querycap_error = EINVAL;
	assert_int_equal(v4l2_identify(DRIVER_FD, &identity), -ENOTTY);
}
