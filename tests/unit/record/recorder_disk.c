// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder_disk.c: what it expects a recording to take, against what one
 * takes, and the room that it asks for. (A disk that fills is in tests/cli/capture.bats.)
 */
#include "recorded.h"

#define SIM "sim:clock=simulated"

/* Not too little, so that the disk is not full before the end; not twice too much. */
static void expects_what_it_takes(void **state)
{
	static const char *const specs[] = {SIM, SIM ",force_hz=50000",
					    SIM ",force_hz=100,tracker_hz=1000"};

	for (size_t i = 0; i < sizeof(specs) / sizeof(*specs); i++) {
		struct incise_rig *rig = open_rig(specs[i]);
		struct incise_calibration calibration;
		struct incise_recorder_setup setup = {.calibration = &calibration};
		struct incise_recorder_stats stats;
		struct incise_error err = {0};
		struct incise_recorder *rec;
		double expected_s;
		struct stat st;

		incise_calibration_nominal(&calibration);
		rec = incise_recorder_new("a.rec", rig, &setup, &err);
		if (!rec)
			fail_msg("%s", err.text);
		incise_recorder_stats(rec, &stats);
		expected_s = stats.bytes_per_s;
		assert_true(stats.disk_s > 0);
		assert_int_equal(poll_for(rec, rig, 10000 * MS, &err), 0);
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		assert_int_equal(stat("a.rec/recording.db", &st), 0);
		if (st.st_size / 10.0 > expected_s || st.st_size / 10.0 < expected_s / 2)
			fail_msg("%s: %.0f bytes/s, expected %.0f", specs[i],
				 st.st_size / 10.0, expected_s);
		assert_int_equal(system("rm -r a.rec"), 0);
		incise_rig_close(rig);
	}
}

static void refuses_what_no_disk_holds(void **state)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_calibration calibration;
	/* 31 years of some 200 kB/s: 200 TB */
	struct incise_recorder_setup setup = {.calibration = &calibration,
					      .planned_s = 1e9};
	struct incise_error err = {0};

	incise_calibration_nominal(&calibration);
	assert_null(incise_recorder_new("a.rec", rig, &setup, &err));
	assert_int_equal(errno, ENOSPC);
	assert_int_equal(err.code, ENOSPC);
	assert_non_null(strstr(err.text, "record for a shorter time"));
	assert_int_equal(access("a.rec.part", F_OK), -1);
	incise_rig_close(rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(expects_what_it_takes),
		IN_FOLDER(refuses_what_no_disk_holds),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
