// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/calibration.c: the paper's figures and calibration.conf.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <incise/calibration.h>
#include "temp_file.h"

static void nominal_is_the_papers(void **state)
{
	struct incise_calibration c;

	incise_calibration_nominal(&c);
	assert_true(c.force_mV_N == 1240);
	assert_true(isnan(c.force_zero_mV));
	assert_true(c.depth_mm_px == 0.11875); /* 47.5 mm over 400 px */
	assert_true(isnan(c.force_delay_ms) && isnan(c.tracker_delay_ms) &&
		    isnan(c.camera_delay_ms) && isnan(c.tracker_delay_sd_ms));
}

static void absent_keys_are_nominal(void **state)
{
	struct temp_file file =
		temp_file_new("calibration.conf", "force_zero_mV = 175.5;\n");
	struct incise_calibration c = {.force_mV_N = 1, .force_zero_mV = 2};

	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1240 && c.force_zero_mV == 175.5);
	assert_true(c.depth_mm_px == 0.11875);
	temp_file_free(&file);
}

static void all_keys_are_read(void **state)
{
	struct temp_file file = temp_file_new(
		"calibration.conf",
		"force_mV_N = 1238.5;\nforce_zero_mV = -12;\ndepth_mm_px = 0.12;\n"
		"force_delay_ms = 0.1;\nforce_delay_sd_ms = 0.01;\n"
		"tracker_delay_ms = 8.5;\ntracker_delay_sd_ms = 0.2;\n"
		"camera_delay_ms = -3.5;\ncamera_delay_sd_ms = 0.5;\n");
	struct incise_calibration c;

	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1238.5 && c.force_zero_mV == -12 &&
		    c.depth_mm_px == 0.12);
	assert_true(c.force_delay_ms == 0.1 && c.force_delay_sd_ms == 0.01);
	assert_true(c.tracker_delay_ms == 8.5 && c.tracker_delay_sd_ms == 0.2);
	assert_true(isnan(c.stepper_N_step) && isnan(c.stepper_steps_s));
	assert_true(c.camera_delay_ms == -3.5 && c.camera_delay_sd_ms == 0.5);
	temp_file_free(&file);
}

static void faults_leave_the_calibration_alone(void **state)
{
	static const struct {
		const char *text, *tail;
	} row[] = {
		{"\nforce_mV_N = 0;",
		 ":2: force_mV_N: expected a number from 1 to 100000, "
		 "found 0; correct it"},
		{"force_zero_mV = 1e5;",
		 ":1: force_zero_mV: expected a number from -10000 to "
		 "10000, found 100000; correct it"},
		{"depth_mm_px = \"x\";",
		 ":1: depth_mm_px: expected a number from 0.0001 to "
		 "10, found \"x\"; correct it"},
		{"gain = 1;",
		 ":1: gain: unknown key; expected one of force_mV_N, force_zero_mV, "
		 "depth_mm_px, tip_mm, force_delay_ms, force_delay_sd_ms, "
		 "tracker_delay_ms, tracker_delay_sd_ms, camera_delay_ms, "
		 "camera_delay_sd_ms, stepper_N_step, stepper_backlash_mm, "
		 "stepper_hysteresis_N, stepper_stiction_N, stepper_steps_s, history"},
		{"force_mV_N", ":1: syntax error: expected `key = value;`; correct it"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("calibration.conf", row[i].text);
		struct incise_calibration c = {
			.force_mV_N = 1, .force_zero_mV = 2, .depth_mm_px = 3};
		struct incise_error err = {0};
		char expected[600];

		assert_int_equal(incise_calibration_load(file.path, &c, &err), -EINVAL);
		snprintf(expected, sizeof(expected), "%s%s", file.path, row[i].tail);
		assert_string_equal(err.text, expected);
		assert_int_equal(err.code, EINVAL);
		assert_true(c.force_mV_N == 1 && c.force_zero_mV == 2 &&
			    c.depth_mm_px == 3);
		temp_file_free(&file);
	}
	assert_int_equal(incise_calibration_load("/nowhere/c.conf",
						 &(struct incise_calibration){0}, NULL),
			 -ENOENT);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(nominal_is_the_papers),
		cmocka_unit_test(absent_keys_are_nominal),
		cmocka_unit_test(all_keys_are_read),
		cmocka_unit_test(faults_leave_the_calibration_alone),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
