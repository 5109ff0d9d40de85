// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/source_setup.c: each key with its range and default, and what is said of those
 * that are wrong.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>
#include "../../../lib/device/source_setup.h"

struct all {
	struct incise_tracker_setup tracker;
	struct incise_force_setup force;
	struct incise_camera_setup camera;
	struct incise_vision_setup vision;
	bool has_vision;
};

static int read_all(const char *text, struct all *all, struct incise_error *err)
{
	config_t config;
	const config_setting_t *root;
	int rc;

	config_init(&config);
	if (config_read_string(&config, text) != CONFIG_TRUE)
		fail_msg("%s: %s", text, config_error_text(&config));
	root = config_root_setting(&config);
	rc = incise_tracker_setup_read(&all->tracker, root, "rig.conf", err);
	if (!rc)
		rc = incise_force_setup_read(&all->force, root, "rig.conf", err);
	if (!rc)
		rc = incise_camera_setup_read(&all->camera, root, "rig.conf", err);
	if (!rc)
		rc = incise_vision_setup_read(&all->vision, &all->has_vision, root,
					      "rig.conf", err);
	config_destroy(&config);
	return rc;
}

static void without_groups_all_is_by_default(void **state)
{
	struct incise_error err = {0};
	struct all all;

	assert_int_equal(read_all("", &all, &err), 0);
	assert_int_equal(all.tracker.n_stations, 1);
	assert_int_equal(all.tracker.stations[0], 1);
	assert_true(all.tracker.hemisphere[0] == 1 && all.tracker.tip_mm[2] == 0);
	assert_int_equal(all.tracker.sync, INCISE_TRACKER_INTERNAL);
	assert_true(all.force.rate_hz == 10000 && all.force.full_scale_V == 0);
	assert_string_equal(all.force.trigger, "");
	assert_int_equal(all.camera.pixels, INCISE_PIXELS_YUYV);
	assert_int_equal(all.camera.width, 0);
	assert_false(all.has_vision);
}

static void an_empty_vision_is_of_a_black_handle(void **state)
{
	struct incise_error err = {0};
	struct all all;

	assert_int_equal(read_all("vision = {};", &all, &err), 0);
	assert_true(all.has_vision);
	assert_true(all.vision.hue[0] == 0 && all.vision.hue[1] == 179);
	assert_true(all.vision.saturation[0] == 0 && all.vision.saturation[1] == 255);
	assert_true(all.vision.value[0] == 0 && all.vision.value[1] == 60);
	assert_true(all.vision.full_px == 0 && all.vision.depth_mm_px == 0);
	assert_int_equal(all.vision.roi.width, 0);
}

static void all_keys_are_read(void **state)
{
	struct incise_error err = {0};
	struct all all;

	if (read_all("tracker_setup = { stations = [2, 4]; hemisphere = [0.0, 0.0, -2.0];"
		     " sync = \"external\"; tip_mm = [1.0, 2.0, 3.5]; };"
		     "force_setup = { rate_hz = 5000; channel = 3; full_scale_V = 5.0;"
		     " trigger = \"my trigger\"; };"
		     "camera_setup = { width = 640; height = 480; rate_hz = 59.94;"
		     " format = \"grey\"; exposure_ms = 4.5; gain = 10;"
		     " white_balance_K = 5000; focus = 7; };"
		     "vision = { hue = [170, 10]; saturation = [80, 255]; value = [9, 9];"
		     " full_px = 400.5; roi = [8192, 0, 16, 8192]; };",
		     &all, &err))
		fail_msg("%s", err.text);
	assert_int_equal(all.tracker.n_stations, 2);
	assert_int_equal(all.tracker.stations[1], 4);
	assert_true(all.tracker.hemisphere[2] == -1 && all.tracker.tip_mm[2] == 3.5);
	assert_int_equal(all.tracker.sync, INCISE_TRACKER_EXTERNAL);
	assert_true(all.force.rate_hz == 5000 && all.force.channel == 3 &&
		    all.force.full_scale_V == 5);
	assert_string_equal(all.force.trigger, "my trigger");
	assert_true(all.camera.width == 640 && all.camera.height == 480 &&
		    all.camera.rate_hz == 59.94 && all.camera.exposure_ms == 4.5 &&
		    all.camera.gain == 10 && all.camera.white_balance_K == 5000 &&
		    all.camera.focus == 7);
	assert_int_equal(all.camera.pixels, INCISE_PIXELS_GREY);
	assert_true(all.has_vision);
	assert_true(all.vision.hue[0] == 170 && all.vision.hue[1] == 10);
	assert_true(all.vision.saturation[0] == 80 && all.vision.saturation[1] == 255);
	assert_true(all.vision.value[0] == 9 && all.vision.value[1] == 9);
	assert_true(all.vision.full_px == 400.5 && all.vision.depth_mm_px == 0);
	assert_true(all.vision.roi.x == 8192 && all.vision.roi.y == 0 &&
		    all.vision.roi.width == 16 && all.vision.roi.height == 8192);
}

static void what_is_wrong_is_said(void **state)
{
	static const struct {
		const char *text, *says;
	} cases[] = {
		{"tracker_setup = 3;", "rig.conf:1: tracker_setup: expected a group"},
		{"tracker_setup = { station = [1]; };", "station"},
		{"tracker_setup = { stations = []; };", "numbers of 1 to 4"},
		{"tracker_setup = { stations = [0]; };", "numbers of 1 to 4"},
		{"tracker_setup = { stations = { a = 1; }; };", "numbers of 1 to 4"},
		{"tracker_setup = { stations = [2, 1]; };", "ascending"},
		{"tracker_setup = { stations = [1, 1]; };", "ascending"},
		{"tracker_setup = { stations = [1, 2, 3, 4, 4]; };", "numbers of 1 to 4"},
		{"tracker_setup = { stations = 1; };", "numbers of 1 to 4"},
		{"tracker_setup = { stations = [\"1\"]; };", "numbers of 1 to 4"},
		{"tracker_setup = { hemisphere = [0.0, 0.0, 0.0]; };", "hemisphere"},
		{"tracker_setup = { sync = \"slow\"; };",
		 "expected one of internal, external, video, found \"slow\""},
		{"tracker_setup = { tip_mm = [1.0, 2.0]; };", "tip_mm"},
		{"\nforce_setup = { rate_hz = 0.5; };", "rig.conf:2: "},
		{"force_setup = { rate_hz = 100001; };", "rate_hz"},
		{"force_setup = { channel = -1; };", "channel"},
		{"force_setup = { full_scale_V = 0.0; };", "full_scale_V"},
		{"force_setup = { trigger = \"../../etc\"; };", "without a slash"},
		{"force_setup = { trigger = \"0123456789012345678901234567890123456789"
		 "012345678901234567890123\"; };",
		 "at most 63 letters"},
		{"camera_setup = { width = 15; };", "width"},
		{"camera_setup = { height = 16385; };", "height"},
		{"camera_setup = { format = \"h264\"; };", "rgb, grey, yuyv, mjpeg"},
		{"camera_setup = { exposure_ms = 0; };", "exposure_ms"},
		{"camera_setup = { zoom = 1; };", "zoom"},
		{"vision = 3;", "rig.conf:1: vision: expected a group"},
		{"vision = { depth_mm_px = 0.1; };", "depth_mm_px"},
		{"\nvision = { hue = [0, 180]; };",
		 "rig.conf:2: vision.hue: expected [low, high] of whole numbers from 0 to "
		 "179"},
		{"vision = { hue = [-1, 179]; };", "vision.hue: expected [low"},
		{"vision = { hue = [1]; };", "vision.hue: expected [low"},
		{"vision = { hue = [1, 2, 3]; };", "vision.hue: expected [low"},
		{"vision = { hue = [1.0, 2.0]; };", "vision.hue: expected [low"},
		{"vision = { hue = (1, \"2\"); };", "vision.hue: expected [low"},
		{"vision = { hue = 5; };", "vision.hue: expected [low"},
		{"vision = { hue = { a = 1; b = 2; }; };", "vision.hue: expected [low"},
		{"vision = { saturation = [0, 256]; };", "vision.saturation: expected"},
		{"vision = { saturation = [9, 8]; };",
		 "vision.saturation: expected the lower number first"},
		{"vision = { value = [1, 0]; };",
		 "vision.value: expected the lower number first"},
		{"vision = { value = [0, 256]; };", "from 0 to 255"},
		{"vision = { full_px = 15.9; };", "full_px"},
		{"vision = { full_px = 8193; };", "full_px"},
		{"vision = { roi = [0, 0, 640]; };",
		 "vision.roi: expected [x, y, width, height] of"},
		{"vision = { roi = [0, -1, 640, 480]; };", "vision.roi: expected [x, y"},
		{"vision = { roi = [0, 0, 8193, 480]; };", "from 0 to 8192"},
		{"vision = { roi = [0, 0, 15, 480]; };", "of 16 or more"},
		{"vision = { roi = [0, 0, 480, 0]; };", "of 16 or more"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct all all;

		if (read_all(cases[i].text, &all, &err) != -EINVAL ||
		    !strstr(err.text, cases[i].says))
			fail_msg("%s: \"%s\"", cases[i].text, err.text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(without_groups_all_is_by_default),
		cmocka_unit_test(an_empty_vision_is_of_a_black_handle),
		cmocka_unit_test(all_keys_are_read),
		cmocka_unit_test(what_is_wrong_is_said),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
