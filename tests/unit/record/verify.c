// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/verify*.c: a good recording is proved, and of each kind of tampering it
 * is said what and where.
 */
#include "verified.h"

#define SIM "sim:clock=simulated"
#define DB "a.rec/recording.db"

static void good_recording_is_complete(void **state)
{
	struct incise_verify_report report;
	struct findings findings;

	record("a.rec", SIM, 1000 * MS);
	verify("a.rec", &report, &findings);
	if (!report.complete)
		fail_msg("%s", findings.text);
	assert_true(report.intact && !report.interrupted && !report.findings);
	assert_int_equal(report.n_streams, 2);
	for (int i = 0; i < 2; i++) {
		const struct incise_verify_stream *stream = &report.streams[i];
		char sql[80];

		assert_string_equal(stream->name, i ? "tracker" : "force");
		snprintf(sql, sizeof(sql), "SELECT count(*) FROM %s", stream->name);
		assert_int_equal(stream->present, (int)ask(DB, sql));
		assert_int_equal(stream->expected, stream->present);
		assert_int_equal(stream->lost + stream->lost_at_capture + stream->altered,
				 0);
		assert_int_equal(stream->blocks, 11); /* 10 commits and the end */
	}
}

/* Force has 1000 rows a block, the tracker 12 or so; 3000 ms, 30 blocks and the end. */
static void tampering_is_found(void **state)
{
	static const struct {
		const char *sql, *text;
		int64_t first_block, last_block; /* of the first finding; -1: none */
		uint64_t lost, altered;		 /* samples and blocks of all streams */
	} cases[] = {
		{"DELETE FROM force WHERE seq = 2345",
		 "force: 1 missing, number 2345, before 0.2346 s\nforce: block 2 is "
		 "altered, numbers 2000 to 2999, 0.2000 to 0.2999 s: 999 rows, and 1000",
		 -1, -1, 1, 1},
		{"DELETE FROM force WHERE seq BETWEEN 2990 AND 3009",
		 "20 missing, numbers 2990 to 3009", -1, -1, 20, 2},
		{"DELETE FROM force WHERE seq < 5", "5 missing, numbers 0 to 4", -1, -1,
		 5, 1},
		{"DELETE FROM force WHERE seq >= 29990",
		 "10 missing at the end, numbers 29990 to 29999", 29, 29, 10, 1},
		{"DELETE FROM force", "30000 missing at the end, numbers 0 to 29999", 0,
		 29, 30000, 30},
		{"UPDATE force SET code = code + 1 WHERE seq = 0", "block 0", 0, 0, 0, 1},
		{"UPDATE force SET code = code + 1 WHERE seq = 12345", "block 12", 12, 12,
		 0, 1},
		{"UPDATE force SET code = 'x' WHERE seq = 12345", "block 12", 12, 12, 0,
		 1},
		{"UPDATE force SET code = code + 1 WHERE seq = 29999", "block 29", 29, 29,
		 0, 1},
		{"UPDATE force SET t_ns = t_ns + 1 WHERE seq = 12345", "block 12", 12, 12,
		 0, 1},
		{"UPDATE force SET code = 4095 - code WHERE seq % 1000 = 7",
		 "blocks 0 to 29 are altered", 0, 29, 0, 30},
		{"UPDATE tracker SET x_mm = x_mm + 1e-9 WHERE seq = 50",
		 "tracker: block 4", 4, 4, 0, 1},
		{"UPDATE tracker SET button = 1 WHERE seq = 50", "tracker: block 4", 4, 4,
		 0, 1},
		{"UPDATE tracker SET status = '  ' WHERE seq = 50", "tracker: block 4", 4,
		 4, 0, 1},
		/* rows swapped */
		{"UPDATE force SET seq = -1 WHERE seq = 12345; UPDATE force SET seq = 12345 "
		 "WHERE seq = 16001; UPDATE force SET seq = 16001 WHERE seq = -1",
		 "block 16", 12, 12, 0, 2},
		/* a row inserted: before, behind */
		{"INSERT INTO force VALUES(-1, 0, 7)", "block 0", 0, 0, 0, 1},
		{"INSERT INTO force VALUES(30000, 9000000000, 7)",
		 "force: 1 rows behind the end of the ledger, numbers 30000 to 30000", -1,
		 -1, 0, 0},
		/* the ledger */
		{"DELETE FROM ledger WHERE stream = 'force' AND block = 0",
		 "no entry of block 0; 1000 rows", 0, 0, 0, 1},
		{"DELETE FROM ledger WHERE stream = 'force' AND block = 5",
		 "no entry of block 5; 1000 rows", 5, 5, 0, 1},
		/* how the rows were parted is lost with them, so the next is in doubt */
		{"DELETE FROM ledger WHERE stream = 'force' AND block IN (5, 6)",
		 "no entry of block 5 to 6; 2000 rows", 5, 6, 0, 3},
		{"DELETE FROM ledger WHERE stream = 'force' AND count = 0",
		 "the ledger has no end", 30, 30, 0, 0},
		{"DELETE FROM ledger", "30000 rows behind", -1, -1, 0, 0},
		{"UPDATE ledger SET crc = (crc | 1) - (crc & 1) WHERE stream = 'force' AND block = 5",
		 "block 5 is", 5, 5, 0, 1},
		{"UPDATE ledger SET first_ns = first_ns + 1 WHERE stream = 'force' AND block "
		 "= 5",
		 "block 5 is", 5, 5, 0, 1},
		{"UPDATE ledger SET last_seq = last_seq - 1 WHERE stream = 'force' AND block "
		 "= 5",
		 "blocks 5 to 6 are", 5, 6, 0, 2},
		{"UPDATE ledger SET count = 'x' WHERE stream = 'force' AND block = 5",
		 "block 5 is", 5, 5, 0, 1},
		{"UPDATE ledger SET lost = 3 WHERE stream = 'force' AND block = 5",
		 "block 5 is", 5, 5, 3, 1},
		{"UPDATE ledger SET lost = 3 WHERE stream = 'force' AND count = 0",
		 "block 30 is", 30, 30, 3, 1},
		{"UPDATE ledger SET block = 9223372036854775807 WHERE stream = 'force' AND "
		 "count = 0",
		 "block 30 is", 30, 30, 0, 1},
		{"INSERT INTO ledger VALUES('odour', 0, 0, 0, 0, 0, 1, 0, 0)",
		 "streams that there are not", -1, -1, 0, 0},
		/* blocks 5 and 6 change places */
		{"UPDATE ledger SET block = -block WHERE stream = 'force' AND block IN (5, "
		 "6); UPDATE ledger SET block = 11 + block WHERE block < 0",
		 "blocks 5 to 7 are", 5, 7, 0, 3},
		/* the tail cut off with its blocks; with the end put back */
		{"DELETE FROM force WHERE seq >= 29000; DELETE FROM ledger WHERE stream = "
		 "'force' AND block >= 29",
		 "force: the ledger has no end", 29, 29, 1000, 0},
		{"DELETE FROM force WHERE seq >= 29000; DELETE FROM ledger WHERE stream = "
		 "'force' AND block = 29",
		 "no entry of block 29; 0 rows", 29, 29, 1000, 2},
		{"UPDATE meta SET value = value + 1 WHERE key = 'force_rows'",
		 "30001 rows were written, and the ledger has 30000", -1, -1, 1, 0},
		{"UPDATE meta SET value = value + 1 WHERE key = 'tracker_lost'",
		 "tracker: 1 were lost when it was captured, and the ledger has 0", -1,
		 -1, 1, 0},
		/* what is sealed */
		{"DELETE FROM depth WHERE seq = 7", "table depth has ", -1, -1, 0, 0},
		{"UPDATE depth SET depth_mm = depth_mm + 1e-9 WHERE seq = 7",
		 "table depth is altered", -1, -1, 0, 0},
		{"UPDATE meta SET value = 7.0 WHERE key = 'force_mV_N'",
		 "table meta is altered", -1, -1, 0, 0},
		{"INSERT INTO meta VALUES('odour', 7)", "table meta has ", -1, -1, 0, 0},
		{"UPDATE events SET text = 'nothing' WHERE kind = 'zero'",
		 "table events is altered", -1, -1, 0, 0},
		{"INSERT INTO events VALUES(7, 'cut', 'one more')", "table events has ",
		 -1, -1, 0, 0},
		{"UPDATE streams SET delay_ns = delay_ns + 1 WHERE name = 'force'",
		 "table streams is altered", -1, -1, 0, 0},
		{"INSERT INTO knots VALUES('force', 9, 7, 7, 1.0, 1)", "table knots has ",
		 -1, -1, 0, 0},
		{"DELETE FROM ledger WHERE stream = 'table:meta'",
		 "table meta has no seal in the ledger", -1, -1, 0, 0},
		{"UPDATE ledger SET crc = (crc | 1) - (crc & 1) + 2 WHERE stream = "
		 "'table:depth'",
		 "table depth is altered", -1, -1, 0, 0},
		{"UPDATE ledger SET lost = 1 WHERE stream = 'table:depth'",
		 "table depth is altered", -1, -1, 0, 0},
		{"UPDATE ledger SET block = 1 WHERE stream = 'table:depth'",
		 "table depth is altered", -1, -1, 0, 0},
		{"INSERT INTO ledger SELECT stream, 1, 0, 0, 0, 0, count, 0, crc FROM ledger "
		 "WHERE stream = 'table:depth'",
		 "table depth is altered", -1, -1, 0, 0},
	};

	record("good.rec", SIM, 3000 * MS);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_verify_report report;
		struct findings findings;
		uint64_t lost = 0, altered = 0;

		assert_int_equal(system("rm -rf a.rec; cp -r good.rec a.rec"), 0);
		change(DB, cases[i].sql);
		verify("a.rec", &report, &findings);
		for (int j = 0; j < report.n_streams; j++) {
			lost += report.streams[j].lost;
			altered += report.streams[j].altered;
		}
		if (report.complete || report.intact || report.interrupted ||
		    !strstr(findings.text, cases[i].text) || lost != cases[i].lost ||
		    altered != cases[i].altered)
			fail_msg("%s: %d, %llu lost, %llu altered: %s", cases[i].sql,
				 report.complete, (unsigned long long)lost,
				 (unsigned long long)altered, findings.text);
		if (findings.first.first_block != cases[i].first_block ||
		    findings.first.last_block != cases[i].last_block)
			fail_msg("%s: %s", cases[i].sql, findings.text);
	}
}

/* What was lost before it was written is said, but is no alteration. */
static void losses_are_no_alteration(void **state)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_verify_report report;
	struct incise_force_sample drop[2000];
	struct findings findings;
	struct incise_error err = {0};
	struct incise_recorder *recorder;

	recorder = start_recorder("a.rec", rig);
	assert_int_equal(poll_for(recorder, rig, 700 * MS, &err), 0);
	/* someone else takes what the recorder should have had: 700 to 730 ms */
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) + 30 * MS);
	assert_int_equal(incise_force_read(incise_rig_force(rig), drop, 2000), 300);
	assert_int_equal(poll_for(recorder, rig, 300 * MS, &err), 0);
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);

	verify("a.rec", &report, &findings);
	assert_true(!report.complete && report.intact && report.findings == 1);
	assert_int_equal(report.streams[0].lost, 300);
	assert_int_equal(report.streams[0].lost_at_capture, 300);
	assert_int_equal(report.streams[0].altered, 0);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_LOST);
	assert_true(findings.first.last_seq - findings.first.first_seq == 299);
	assert_int_equal(findings.first.count, 300);
	/* the rows around the gap, 0.1 ms apart each */
	assert_int_equal(findings.first.last_ns - findings.first.first_ns,
			 301 * 100000LL);
}

static void interrupted_is_intact(void **state)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_verify_report report;
	struct findings findings;
	struct incise_error err = {0};
	struct incise_recorder *recorder;

	recorder = start_recorder("a.rec", rig);
	verify("a.rec", &report, &findings); /* not a row */
	assert_true(report.interrupted && report.intact && report.findings == 1);
	assert_int_equal(poll_for(recorder, rig, 750 * MS, &err), 0);
	verify("a.rec", &report, &findings); /* as it is written */
	assert_true(report.interrupted && report.intact && !report.complete);
	assert_int_equal(report.findings, 1);
	assert_int_equal(findings.first.kind, INCISE_VERIFY_INTERRUPTED);
	assert_int_equal(report.streams[0].expected, report.streams[0].present);
	assert_true(report.streams[0].present >= 6900); /* commits at 700 ms */
	assert_int_equal(system("cp -r a.rec.part b.rec.part"), 0); /* as kill -9 */
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	verify("b.rec", &report, &findings);
	assert_true(report.interrupted && report.intact);
	assert_non_null(strstr(findings.text, "nothing proves them"));
	/* of them no change is found, but that rows of depth are missing */
	change("b.rec.part/recording.db", "UPDATE events SET text = 'else'");
	verify("b.rec", &report, &findings);
	assert_true(report.interrupted && report.intact);
	change("b.rec.part/recording.db", "DELETE FROM depth WHERE seq = 7");
	verify("b.rec", &report, &findings);
	assert_false(report.intact);
	change("b.rec.part/recording.db", "DELETE FROM force WHERE seq = 77");
	verify("b.rec", &report, &findings);
	assert_true(report.interrupted && !report.intact);
	assert_int_equal(report.streams[0].lost, 1);
}

/* Who says that it was interrupted does not get rid of the seals. */
static void closed_and_not_complete(void **state)
{
	struct incise_verify_report report;
	struct findings findings;

	record("a.rec", SIM, 600 * MS);
	change(DB, "UPDATE meta SET value = 0 WHERE key = 'complete'");
	verify("a.rec", &report, &findings);
	assert_true(report.interrupted && !report.intact);
	assert_non_null(strstr(findings.text, "entries of streams that there are not"));
}

static void what_cannot_be_verified(void **state)
{
	struct incise_verify_report report;
	struct incise_error err = {0};

	assert_int_equal(incise_verify("none.rec", NULL, &report, &err), -ENOENT);
	record("a.rec", SIM, 600 * MS);
	change(DB, TO_FORM_1);
	assert_int_equal(incise_verify("a.rec", NULL, &report, &err), -ENODATA);
	assert_non_null(strstr(err.text, "no ledger"));
}

/* A page in the middle is garbage: found, and no crash, wherever it is. */
static void damaged_pages_are_found(void **state)
{
	struct stat st;

	record("good.rec", SIM, 1000 * MS);
	assert_int_equal(stat("good.rec/recording.db", &st), 0);
	assert_true(st.st_size > 40 * 4096);
	for (int page = 1; page < st.st_size / 4096; page += 2) {
		struct incise_verify_report report;
		struct incise_error err = {0};
		char command[200];

		snprintf(command, sizeof(command),
			 "rm -rf a.rec; cp -r good.rec a.rec; dd if=/dev/zero of=" DB
			 " bs=4096 seek=%d count=1 conv=notrunc 2>/dev/null",
			 page);
		assert_int_equal(system(command), 0);
		/* those of table meta keep it from being opened */
		if (!incise_verify("a.rec", NULL, &report, &err) &&
		    (report.complete || report.intact))
			fail_msg("page %d", page);
	}
}

static void truncated_file(void **state)
{
	struct stat st;

	record("a.rec", SIM, 1000 * MS);
	assert_int_equal(stat(DB, &st), 0);
	for (off_t size = st.st_size - 1; size > 0; size -= 40000) {
		for (int whole = 0; whole < 2; whole++) { /* pages */
			struct incise_verify_report report;
			struct incise_error err = {0};

			if (whole)
				size -= size % 4096;
			assert_int_equal(truncate(DB, size), 0);
			if (!incise_verify("a.rec", NULL, &report, &err) &&
			    report.complete)
				fail_msg("%ld bytes", (long)size);
		}
	}
}

static int stop(void *user, double share)
{
	assert_true((share >= 0 && share <= 1) || share == -1);
	++*(int *)user;
	return 1;
}

static void can_be_stopped(void **state)
{
	int calls = 0;
	struct incise_verify_watch watch = {.progress = stop, .user = &calls};
	struct incise_verify_report report;
	struct incise_error err = {0};

	record("a.rec", SIM, 1000 * MS);
	assert_int_equal(incise_verify("a.rec", &watch, &report, &err), -ECANCELED);
	assert_int_equal(calls, 1);
	assert_false(report.complete);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, enter_folder, leave_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(good_recording_is_complete),
		IN_FOLDER(tampering_is_found),
		IN_FOLDER(losses_are_no_alteration),
		IN_FOLDER(interrupted_is_intact),
		IN_FOLDER(closed_and_not_complete),
		IN_FOLDER(what_cannot_be_verified),
		IN_FOLDER(damaged_pages_are_found),
		IN_FOLDER(truncated_file),
		IN_FOLDER(can_be_stopped),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
