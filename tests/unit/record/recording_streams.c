// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/recording_streams.c: the tables streams and knots, also where somebody
 * wrote into them what cannot be.
 */
#include "recorded.h"
#include "../../../lib/record/read/recording.h"

#define DB "a.rec/recording.db"

static void line_is_read_and_used(void **state)
{
	struct incise_recording_line line;
	struct incise_recording *recording;
	struct incise_error err = {0};

	record("a.rec", "sim:clock=simulated", 700 * MS);
	change(DB, "DELETE FROM knots; INSERT INTO knots VALUES('tracker', 0, 10, 1000, "
		   "5.0, 1), ('tracker', 1, 20, 3000, 7.0, 0), ('tracker', 2, 30, 6000, "
		   "6.0, 0)");
	recording = incise_recording_open("a.rec", &err);
	assert_non_null(recording);
	assert_int_equal(incise_recording_line(recording, "tracker", &line, &err), 0);
	assert_int_equal(line.n, 3);
	assert_int_equal(incise_recording_time(&line, 15, 77), 2000);
	assert_int_equal(incise_recording_time(&line, 25, 77), 4500);
	assert_int_equal(incise_recording_time(&line, 40, 77),
			 9000); /* beyond the last */
	assert_true(incise_recording_time_sd(&line, 15) == 7);
	assert_true(incise_recording_time_sd(&line, 29) == 7);
	/* what has no line has its own times */
	assert_int_equal(incise_recording_line(recording, "force", &line, &err), 0);
	assert_int_equal(line.n, 0);
	assert_int_equal(incise_recording_time(&line, 15, 77), 77);
	assert_true(isnan(incise_recording_time_sd(&line, 15)));
	incise_recording_close(recording);
}

static void what_cannot_be_is_refused(void **state)
{
	static const struct {
		const char *sql;
		bool knots;
	} cases[] = {
		{"INSERT INTO knots VALUES('tracker', 1000, 0, 5, 1.0, 0)", true},
		{"UPDATE knots SET sd_ns = -1.0", true},
		{"UPDATE knots SET sd_ns = 9e999", true},
		{"UPDATE knots SET t_ns = 9223372036854775807", true},
		{"UPDATE knots SET seq = -1", true},
		{"UPDATE knots SET t_ns = 'x'", true},
		{"WITH RECURSIVE n(i) AS (SELECT 1000 UNION ALL SELECT i + 1 FROM n WHERE "
		 "i < 2000) INSERT INTO knots SELECT 'tracker', i, 1000000 + i, "
		 "9000000000000 + i, 1.0, 0 FROM n",
		 true},
		{"UPDATE streams SET drift_ppm = 9e999", false},
		{"UPDATE streams SET jitter_ns = 'much'", false},
		{"UPDATE streams SET lost = -1", false},
		{"UPDATE streams SET name = ''", false},
		{"UPDATE streams SET ended = x'00ff'", false},
		{"INSERT INTO streams SELECT 'more', device, stamped, nominal_hz, "
		 "delay_ns, delay_sd_ns, grain_ns, rows, lost, late, rate_hz, drift_ppm, "
		 "drift_sd_ppm, jitter_ns, jitter_max_ns, offset_ns, offset_sd_ns, ended "
		 "FROM streams; INSERT INTO streams SELECT 'more too', device, stamped, "
		 "nominal_hz, delay_ns, delay_sd_ns, grain_ns, rows, lost, late, rate_hz, "
		 "drift_ppm, drift_sd_ppm, jitter_ns, jitter_max_ns, offset_ns, "
		 "offset_sd_ns, ended FROM streams WHERE name = 'more'",
		 false},
	};

	record("good.rec", "sim:clock=simulated", 2000 * MS);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_recording_line line;
		struct incise_stream streams[INCISE_STREAMS_MAX];
		struct incise_recording *recording;
		struct incise_error err = {0};
		int rc;

		assert_int_equal(system("rm -rf a.rec && cp -r good.rec a.rec"), 0);
		if (strstr(cases[i].sql, "'more'")) /* one name only */
			change(DB, "DELETE FROM streams WHERE name = 'force'");
		if (strstr(cases[i].sql, "name = ''"))
			change(DB, "DELETE FROM streams WHERE name = 'force'");
		change(DB, cases[i].sql);
		if (strstr(cases[i].sql, "'more'"))
			change(DB, "INSERT INTO streams SELECT 'last', device, stamped, "
				   "nominal_hz, delay_ns, delay_sd_ns, grain_ns, rows, "
				   "lost, late, rate_hz, drift_ppm, drift_sd_ppm, "
				   "jitter_ns, jitter_max_ns, offset_ns, offset_sd_ns, "
				   "ended FROM streams WHERE name = 'more'");
		recording = incise_recording_open("a.rec", &err);
		if (!recording)
			fail_msg("%s: %s", cases[i].sql, err.text);
		rc = cases[i].knots
			     ? incise_recording_line(recording, "tracker", &line, &err)
			     : incise_recording_streams(recording, streams, &err);
		if (rc != -EINVAL ||
		    !strstr(err.text, cases[i].knots ? "a.rec: damaged: table knots"
						     : "a.rec: damaged: table "
						       "streams"))
			fail_msg("%s: %d %s", cases[i].sql, rc, err.text);
		incise_recording_close(recording);
	}
}

static void old_recordings_have_none(void **state)
{
	struct incise_recording_line line;
	struct incise_stream streams[INCISE_STREAMS_MAX];
	struct incise_recording *recording;
	struct incise_error err = {0};

	record("a.rec", "sim:clock=simulated", 700 * MS);
	change(DB, TO_FORM_1);
	recording = incise_recording_open("a.rec", &err);
	if (!recording)
		fail_msg("%s", err.text);
	assert_int_equal(incise_recording_streams(recording, streams, &err), 0);
	assert_int_equal(incise_recording_line(recording, "tracker", &line, &err), 0);
	assert_int_equal(line.n, 0);
	incise_recording_close(recording);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, enter_folder, leave_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(line_is_read_and_used),
		TEST(what_cannot_be_is_refused),
		TEST(old_recordings_have_none),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
