// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/recording_values.c: arrays hold what the tables do, at the best times;
 * depth is the calibrated tip's; and no damaged row is believed.
 */
#include "recorded.h"

#define DB "a.rec/recording.db"
#define TIPPED "sim:clock=simulated,tip_x_mm=3,tip_y_mm=-20,tip_z_mm=60"

static struct incise_recording *open_it(void)
{
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open("a.rec", &err);

	if (!recording)
		fail_msg("%s", err.text);
	return recording;
}

static void arrays_are_the_tables(void **state)
{
	struct incise_recording_value *values;
	struct incise_tracker_sample *poses;
	struct incise_recording *recording;
	struct incise_error err = {0};
	double sum = 0;
	int n;

	record("a.rec", SHORT_SCRIPT, 4000 * MS);
	recording = open_it();
	n = incise_recording_values(recording, "force", &values, &err);
	assert_int_equal(n, (int)ask(DB, "SELECT count(*) FROM force"));
	for (int i = 0; i < n; i++)
		sum += values[i].value / n;
	/* 5 V over 4096 codes, 1240 mV/N */
	assert_true(fabs(sum - (ask(DB, "SELECT avg(code) FROM force") * 5000 / 4096 -
				ask(DB, "SELECT value FROM meta WHERE key = "
					"'force_zero_mV'")) /
				       1240) < 1e-9);
	assert_true(values[9].t_ns == ask(DB, "SELECT t_ns FROM force WHERE seq = 9"));
	free(values);
	n = incise_recording_values(recording, "depth", &values, &err);
	assert_int_equal(n, (int)ask(DB, "SELECT count(*) FROM depth"));
	assert_true(values[99].value ==
		    ask(DB, "SELECT depth_mm FROM depth WHERE seq = 99"));
	n = incise_recording_poses(recording, &poses, &err);
	assert_int_equal(n, (int)ask(DB, "SELECT count(*) FROM tracker"));
	assert_true(poses[99].position_mm[2] ==
		    ask(DB, "SELECT z_mm FROM tracker WHERE seq = 99"));
	assert_true(poses[99].quaternion[3] ==
		    ask(DB, "SELECT qz FROM tracker WHERE seq = 99"));
	assert_int_equal(poses[99].status, ' ');
	/* depth rows are the tracker's: the same line gives both their times */
	assert_true(poses[99].t_ns == values[99].t_ns);
	free(poses);
	free(values);
	/* it has no camera, and nothing else either */
	assert_int_equal(incise_recording_values(recording, "camera", &values, &err), 0);
	free(values);
	assert_int_equal(incise_recording_values(recording, "poses", &values, &err),
			 -EINVAL);
	assert_null(values);
	incise_recording_close(recording);
}

static void clipped_force_is_none(void **state)
{
	struct incise_recording_value *values;
	struct incise_recording *recording;
	struct incise_error err = {0};

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB, "UPDATE force SET code = 4095 WHERE seq = 5; "
		   "UPDATE force SET code = 0 WHERE seq = 6");
	recording = open_it();
	assert_true(incise_recording_values(recording, "force", &values, &err) > 6);
	assert_true(isnan(values[5].value) && isnan(values[6].value));
	assert_true(isfinite(values[4].value) && isfinite(values[7].value));
	free(values);
	incise_recording_close(recording);
}

static void a_row_that_cannot_be_is_named(void **state)
{
	struct incise_recording_value *values;
	struct incise_tracker_sample *poses;
	struct incise_recording *recording;
	struct incise_error err = {0};

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB, "UPDATE tracker SET qx = 'none' WHERE seq = 7; "
		   "UPDATE depth SET depth_mm = 9e999 WHERE seq = 7");
	recording = open_it();
	assert_int_equal(incise_recording_poses(recording, &poses, &err), -EINVAL);
	assert_non_null(strstr(err.text, "table tracker, row 7"));
	assert_int_equal(incise_recording_values(recording, "depth", &values, &err),
			 -EINVAL);
	assert_non_null(strstr(err.text, "table depth, row 7"));
	incise_recording_close(recording);
}

/* Rows stay what the device gave; depth is of the calibrated tip. */
static void depth_is_of_the_tip(void **state)
{
	struct incise_rig *rig = open_rig(TIPPED);
	struct incise_recording_info info;
	struct incise_recording *recording;
	struct incise_calibration calibration;
	struct incise_recorder *recorder;
	struct incise_error err = {0};

	incise_calibration_nominal(&calibration);
	calibration.tip_mm[0] = 3;
	calibration.tip_mm[1] = -20;
	calibration.tip_mm[2] = 60;
	recorder = incise_recorder_new(
		"a.rec", rig,
		&(struct incise_recorder_setup){.calibration = &calibration}, &err);
	assert_non_null(recorder);
	if (poll_for(recorder, rig, 900 * MS, &err) ||
	    incise_recorder_close(recorder, &err))
		fail_msg("%s", err.text);
	incise_rig_close(rig);
	recording = open_it();
	assert_int_equal(incise_recording_info(recording, &info, &err), 0);
	assert_true(info.tip_mm[0] == 3 && info.tip_mm[1] == -20 && info.tip_mm[2] == 60);
	incise_recording_close(recording);
	/* In the pause the tip is 1 to 5 mm above; noise at 63 mm is 0.04 mm, tremor 0.03. */
	assert_true(ask(DB, "SELECT max(z_mm) FROM tracker") < -40);
	assert_true(ask(DB, "SELECT max(depth_mm) FROM depth") < -0.7);
	assert_true(ask(DB, "SELECT min(depth_mm) FROM depth") > -5.3);
	change(DB, "UPDATE meta SET value = 1e300 WHERE key = 'tip_y_mm'");
	assert_null(incise_recording_open("a.rec", &err));
	assert_non_null(strstr(err.text, "tip_y_mm"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(arrays_are_the_tables, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(clipped_force_is_none, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(a_row_that_cannot_be_is_named,
						enter_folder, leave_folder),
		cmocka_unit_test_setup_teardown(depth_is_of_the_tip, enter_folder,
						leave_folder),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
