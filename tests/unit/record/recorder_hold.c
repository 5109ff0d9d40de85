// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder_hold.c: the last second before a trigger, and no more.
 */
#include "recorded.h"
#include <incise/verify.h>

#define DB "a.rec/recording.db"
#define SIM "sim:clock=simulated"

static void last_second_is_there(void **state)
{
	/* after so long; what is there from before, ms */
	static const struct {
		int wait_ms, before_ms;
	} cases[] = {{300, 300}, {990, 990}, {5000, 1000}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_rig(SIM);
		struct incise_calibration calibration;
		struct incise_recorder_setup setup = {.calibration = &calibration,
						      .armed = true};
		struct incise_verify_report report;
		struct incise_recorder_stats stats;
		struct incise_error err = {0};
		struct incise_recorder *rec;
		double before_ms, after_ms;

		incise_calibration_nominal(&calibration);
		calibration.force_zero_mV = 180;
		rec = incise_recorder_new("a.rec", rig, &setup, &err);
		if (!rec)
			fail_msg("%s", err.text);
		assert_int_equal(poll_for(rec, rig, cases[i].wait_ms * MS, &err), 0);
		incise_recorder_stats(rec, &stats);
		assert_true(stats.armed && !stats.force && !stats.tracker);
		incise_recorder_trigger(rec);
		assert_int_equal(poll_for(rec, rig, 500 * MS, &err), 0);
		incise_recorder_stats(rec, &stats);
		assert_false(stats.armed);
		assert_int_equal(stats.force_lost + stats.tracker_lost, 0);
		assert_int_equal(incise_recorder_close(rec, &err), 0);
		before_ms = ask(DB, "SELECT (SELECT t_ns FROM events WHERE kind = "
				    "'trigger') - min(t_ns) FROM force") /
			    MS;
		after_ms = ask(DB, "SELECT max(t_ns) - (SELECT t_ns FROM events WHERE "
				   "kind = 'trigger') FROM force") /
			   MS;
		/* The poll that sees the trigger is 10 ms after the wait. */
		if (fabs(before_ms - fmin(cases[i].wait_ms + 10, 1000)) > 0.11 ||
		    fabs(after_ms - 490) > 0.11)
			fail_msg("case %zu: %.2f ms before, %.2f after", i, before_ms,
				 after_ms);
		/* Numbers in a row over the trigger; the tracker's rows with their depth. */
		assert_int_equal(ask(DB, "SELECT max(seq) - min(seq) + 1 - count(*) FROM "
					 "force"),
				 0);
		assert_int_equal(ask(DB,
				     "SELECT (SELECT count(*) FROM tracker) - (SELECT "
				     "count(*) FROM depth)"),
				 0);
		assert_int_equal(incise_verify("a.rec", NULL, &report, &err), 0);
		assert_true(report.complete);
		assert_int_equal(system("rm -r a.rec"), 0);
		incise_rig_close(rig);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(last_second_is_there),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
