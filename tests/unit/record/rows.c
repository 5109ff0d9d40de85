// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/rows.c: which time a row gets, and that times increase whatever
 * a file says.
 */
#include "../unit.h"
#include "recorded.h"
#include "../../../lib/record/read/rows.h"

#define DB "times.rec/recording.db"

/* The recording has knots for the tracker: 8 ms apart, 1 ms earlier than its rows say. */
static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("times.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB,
	       "DELETE FROM streams; INSERT INTO streams(name, device, stamped, "
	       "delay_ns, delay_sd_ns, grain_ns, rows, lost, late, offset_sd_ns) VALUES"
	       "('force', 'f', 1, 0, 0, 0, 1, 0, 0, 3000.0),"
	       "('tracker', 't', 0, 4000000, 300000, 0, 1, 0, 0, 9e9);"
	       /* Their arrivals would show that no line below goes through them. */
	       "DELETE FROM tracker");
	return 0;
}

static void set_knots(const char *values)
{
	char sql[600];

	change(DB, "DELETE FROM knots");
	if (!*values)
		return;
	snprintf(sql, sizeof(sql), "INSERT INTO knots VALUES %s", values);
	change(DB, sql);
}

static struct incise_recording *opened;

static struct incise_row_times open_times(const char *table)
{
	struct incise_row_times times;

	opened = incise_recording_open("times.rec", &err);
	succeeds(opened && !incise_row_times_open(&times, opened, table, &err));
	return times;
}

static void close_times(struct incise_row_times *times)
{
	incise_row_times_close(times);
	incise_recording_close(opened);
}

TEST(a_row_is_on_its_line)
{
	static const struct {
		const char *table;
		int64_t expected; /* of row 25 */
		double sd_s;
	} cases[] = {
		{"tracker", 199 * MS, 5e-4}, {"depth", 199 * MS, 5e-4},
		{"force", 203 * MS, 3e-6},   {"frames", 203 * MS, 0},
		{"events", 203 * MS, 0},
	};

	set_knots("('tracker', 0, 0, -1000000, 5e5, 1),"
		  "('tracker', 1, 100, 799000000, 4e5, 0)");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_row_times times = open_times(cases[i].table);
		int64_t t_ns;

		assert_true(incise_row_times_next(&times, 25, 203 * MS, &t_ns));
		assert_int_equal(t_ns, cases[i].expected);
		assert_true(fabs(incise_row_times_sd(&times, 25) - cases[i].sd_s) <
			    1e-12);
		/* the row's own time is checked as well */
		assert_false(incise_row_times_next(&times, 26, 202 * MS, &t_ns));
		assert_int_equal(incise_row_times_next(&times, 26, 203 * MS, &t_ns),
				 !strcmp(cases[i].table, "events"));
		assert_false(incise_row_times_next(&times, 27, INT64_MAX, &t_ns));
		close_times(&times);
	}
}

TEST(another_delay_shifts)
{
	static const struct {
		const char *table;
		int64_t expected;
		double sd_s;
	} cases[] = {
		/* 4 ms were taken off, 7.5 are to be; 0.5² - 0.3² + 1.2² */
		{"tracker", 203 * MS - 3500000, 1.2649111e-3},
		{"depth", 203 * MS - 3500000, 1.2649111e-3},
		/* none were, or it is not known */
		{"force", 203 * MS + 250000, 3e-6},
		{"frames", 203 * MS - 300 * MS, 0}, /* negative, and stays so */
	};
	struct incise_calibration calibration;

	incise_calibration_nominal(&calibration);
	calibration.tracker_delay_ms = 7.5;
	calibration.tracker_delay_sd_ms = 1.2;
	calibration.force_delay_ms = -0.25;
	calibration.camera_delay_ms = 300;
	set_knots("('tracker', 0, 0, 3000000, 5e5, 1), ('tracker', 1, 100, 803000000, "
		  "5e5, 0)");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_row_times times = open_times(cases[i].table);
		int64_t t_ns;

		incise_row_times_calibrate(&times, &calibration);
		assert_true(incise_row_times_next(&times, 25, 203 * MS, &t_ns));
		assert_int_equal(t_ns, cases[i].expected);
		assert_true(fabs(incise_row_times_sd(&times, 25) - cases[i].sd_s) < 1e-8);
		close_times(&times);
	}
}

TEST(times_increase_whatever_knots_say)
{
	static const char *const cases[] = {
		"",
		/* less than a nanosecond per row */
		"('tracker', 0, 0, 5, 1.0, 1), ('tracker', 1, 1000000, 6, 1.0, 0)",
		/* the first line goes on past the second one's beginning */
		"('tracker', 0, 0, 0, 1.0, 1), ('tracker', 1, 10, 1000000000, 1.0, 0),"
		"('tracker', 2, 90, 1000000001, 1.0, 1), ('tracker', 3, 95, 1000000002, "
		"1.0, 0)",
		/* as far as knots go */
		"('tracker', 0, 0, -4611686018427387903, 1.0, 1), "
		"('tracker', 1, 9, 4611686018427387903, 1.0, 0)",
		"('tracker', 0, 200, 5, 1.0, 1), "
		"('tracker', 1, 201, 4611686018427387903, 1.0, 0)",
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int64_t t_ns, last_ns = INCISE_TIME_NONE;
		struct incise_row_times times;

		set_knots(cases[i]);
		times = open_times("depth");
		times.shift_ns = -77;
		for (int64_t seq = -3; seq < 300; seq++, last_ns = t_ns) {
			assert_true(incise_row_times_next(&times, seq, seq + 3, &t_ns));
			assert_true(t_ns > last_ns);
			assert_true(incise_row_times_sd(&times, seq) >= 0);
		}
		close_times(&times);
	}
}

GROUP(record_once, leave_folder);
