// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/v4l2/v4l2_scan.c in a folder that the test fills as udev does, with cameras of
 * the driver that it plays.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../../../lib/device/v4l2/v4l2_camera.h"
#include "driver.h"

static char dev[64];
static struct incise_scan_device seen[8];
static int n, answer;
static struct incise_error err;

static int note(void *context, const struct incise_scan_device *device)
{
	assert_ptr_equal(context, &n);
	assert_in_range(n, 0, 7);
	seen[n++] = *device;
	return answer;
}

static int scan(const char *arguments)
{
	n = 0;
	err = (struct incise_error){0};
	return v4l2_camera_scan_in(dev, arguments, note, &n, &err);
}

static const char *in_dev(const char *name)
{
	static char path[160];

	snprintf(path, sizeof(path), "%s/%s", dev, name);
	return path;
}

static int fill(void **state)
{
	snprintf(dev, sizeof(dev), "/tmp/incise-scan.XXXXXX");
	if (!mkdtemp(dev))
		return -1;
	for (int i = 0; i < 3; i++) {
		char name[16];

		snprintf(name, sizeof(name), "video%d", i);
		if (mknod(in_dev(name), S_IFREG | 0600, 0))
			return -1;
	}
	mkdir(in_dev("v4l"), 0700);
	mkdir(in_dev("v4l/by-id"), 0700);
	mkdir(in_dev("v4l/by-path"), 0700);
	return symlink("../../video1", in_dev("v4l/by-id/usb-Cam_77-video-index0")) ||
	       symlink("../../video0", in_dev("v4l/by-path/pci-1-video-index0")) ||
	       symlink("../../video1", in_dev("v4l/by-path/pci-2-video-index0"));
}

static int empty(void **state)
{
	char command[100];

	snprintf(command, sizeof(command), "rm -r %s", dev);
	return system(command);
}

static void cameras_are_named_by_what_stays(void **state)
{
	char expected[200];

	driver_reset();
	answer = 0;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 3);
	snprintf(expected, sizeof(expected), "v4l2:%s/v4l/by-path/pci-1-video-index0",
		 dev);
	assert_string_equal(seen[0].device, expected);
	snprintf(expected, sizeof(expected), "v4l2:%s/v4l/by-id/usb-Cam_77-video-index0",
		 dev);
	assert_string_equal(seen[1].device, expected);
	snprintf(expected, sizeof(expected), "v4l2:%s/video2", dev);
	assert_string_equal(seen[2].device, expected);
	assert_non_null(strstr(seen[0].what, "(YUYV MJPG)"));
	assert_int_equal(strncmp(seen[0].what, "C?CCC", 5), 0);
	assert_string_equal(seen[0].property[1].key, "driver");
	assert_string_equal(seen[0].property[1].text, "played");
	assert_int_equal(driver.opened, 0);
}

static void one_may_be_asked_for(void **state)
{
	driver_reset();
	answer = 0;
	assert_int_equal(scan(in_dev("video2")), 0);
	assert_int_equal(n, 1);
	driver.open_error = ENOENT;
	assert_int_equal(scan(in_dev("video9")), 0);
	assert_int_equal(n, 0);
	driver.open_error = EIO;
	assert_int_equal(scan(in_dev("video2")), -EIO);
}

static void who_has_seen_enough_ends_it(void **state)
{
	driver_reset();
	answer = -77;
	assert_int_equal(scan(""), -77);
	assert_int_equal(n, 1);
	answer = 5;
	assert_int_equal(scan(""), 5);
	assert_int_equal(n, 1);
}

static void what_is_no_camera_is_passed_over(void **state)
{
	driver_reset();
	answer = 0;
	driver.capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 0);
	driver.querycap_error = ENOTTY;
	assert_int_equal(scan(""), 0);
	assert_int_equal(n, 0);
	assert_int_equal(driver.opened, 0);
}

static void who_may_not_look_is_told(void **state)
{
	driver_reset();
	driver.open_error = EACCES;
	assert_int_equal(scan(""), -EACCES);
	assert_non_null(strstr(err.text, "member of the group"));
	assert_int_equal(n, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(cameras_are_named_by_what_stays),
		cmocka_unit_test(one_may_be_asked_for),
		cmocka_unit_test(who_has_seen_enough_ends_it),
		cmocka_unit_test(what_is_no_camera_is_passed_over),
		cmocka_unit_test(who_may_not_look_is_told),
	};

	return cmocka_run_group_tests(tests, fill, empty);
}
