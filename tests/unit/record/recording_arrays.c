// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/recording_arrays.c: arrays hold the rows of the tables, at the best
 * times; depth is the calibrated tip's; damaged rows are errors.
 */
#include "../unit.h"
#include "recorded.h"
#include <incise/depth_pairs.h>

#define DB "a.rec/recording.db"
#define TIPPED "sim:clock=simulated,tip_x_mm=3,tip_y_mm=-20,tip_z_mm=60"

TEST(arrays_are_the_tables, IN_FOLDER)
{
	struct incise_recording_value *values;
	struct incise_tracker_sample *poses;
	struct incise_recording *recording;
	double sum = 0;
	int n;

	record("a.rec", SHORT_SCRIPT, 4000 * MS);
	recording = open_recording("a.rec");
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

TEST(clipped_force_is_none, IN_FOLDER)
{
	struct incise_recording_value *values;
	struct incise_recording *recording;

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB, "UPDATE force SET code = 4095 WHERE seq = 5; "
		   "UPDATE force SET code = 0 WHERE seq = 6");
	recording = open_recording("a.rec");
	assert_true(incise_recording_values(recording, "force", &values, &err) > 6);
	assert_true(isnan(values[5].value) && isnan(values[6].value));
	assert_true(isfinite(values[4].value) && isfinite(values[7].value));
	free(values);
	incise_recording_close(recording);
}

TEST(a_row_that_cannot_be_is_named, IN_FOLDER)
{
	struct incise_recording_value *values;
	struct incise_tracker_sample *poses;
	struct incise_recording *recording;

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB, "UPDATE tracker SET qx = 9e999 WHERE seq = 7");
	recording = open_recording("a.rec");
	assert_error(incise_recording_poses(recording, &poses, &err), EINVAL, &err,
		     "stream tracker, block 0");
	assert_error(incise_recording_values(recording, "depth", &values, &err), EINVAL,
		     &err, "stream tracker, block 0");
	incise_recording_close(recording);
}

/* Rows stay what the device gave; depth is of the calibrated tip. */
TEST(depth_is_of_the_tip, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(TIPPED);
	struct incise_recording_info info;
	struct incise_recording *recording;
	struct incise_calibration calibration;

	incise_calibration_nominal(&calibration);
	calibration.tip_mm[0] = 3;
	calibration.tip_mm[1] = -20;
	calibration.tip_mm[2] = 60;
	end_recorder(start_recorder_by(
			     "a.rec", rig,
			     (struct incise_recorder_setup){.calibration = &calibration}),
		     rig, 900 * MS);
	recording = open_recording("a.rec");
	assert_int_equal(incise_recording_info(recording, &info, &err), 0);
	assert_true(info.tip_mm[0] == 3 && info.tip_mm[1] == -20 && info.tip_mm[2] == 60);
	incise_recording_close(recording);
	/* In the pause the tip is 1 to 5 mm above; noise at 63 mm is 0.04 mm, tremor 0.03. */
	assert_true(ask(DB, "SELECT max(z_mm) FROM tracker") < -40);
	assert_true(ask(DB, "SELECT max(depth_mm) FROM depth") < -0.7);
	assert_true(ask(DB, "SELECT min(depth_mm) FROM depth") > -5.3);
	change(DB, "UPDATE meta SET value = 1e300 WHERE key = 'tip_y_mm'");
	assert_null(incise_recording_open("a.rec", &err));
	assert_says(err.text, "tip_y_mm");
}

/* --- arrays ---------------------------------------------------------------------- */

/* All of a stream; ends as incise_recording_values(). */
static int values_of(const char *name, struct incise_recording_value **values,
		     struct incise_error *err)
{
	struct incise_recording *recording = open_recording("a.rec");
	int n = incise_recording_values(recording, name, values, err);

	incise_recording_close(recording);
	return n;
}

#define NUMBERS \
	"WITH RECURSIVE i(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM i WHERE n < 9999) "

TEST(elements_are_rows, IN_FOLDER)
{
	struct incise_recording_value *values;

	record("a.rec", "sim:clock=simulated", 600 * MS);
	/* more than the first capacity, and than twice of it */
	change(DB,
	       "DELETE FROM knots; DELETE FROM tracker; UPDATE meta SET value = 10000 "
	       "WHERE key = 'tracker_rows'; " NUMBERS
	       "INSERT INTO tracker SELECT n, 1000 * n, 1000 * n, 0, 0, -n - 1.0, 1, 0, "
	       "0, 0, ' ', 1, 0 FROM i");
	assert_int_equal(values_of("depth", &values, &err), 10000);
	for (int i = 0; i < 10000; i++)
		assert_true(values[i].value == i + 1);
	free(values);

	change(DB,
	       NUMBERS "INSERT INTO frames SELECT n, 1000 * n, 0, n, 1, 0, NULL, NULL, "
		       "iif((n + 1) % 4, NULL, n + 1.0), NULL, zeroblob(32) FROM i");
	assert_int_equal(values_of("camera", &values, &err), 2500);
	assert_true(values[0].value == 4 && values[2499].value == 10000);
	free(values);

	change(DB, "UPDATE frames SET depth_mm = NULL");
	assert_int_equal(values_of("camera", &values, &err), 0);
	assert_null(values);
}

TEST(after_a_failure_there_is_none, IN_FOLDER)
{
	struct incise_recording_value *values;

	record("a.rec", "sim:clock=simulated", 600 * MS);
	change(DB, "UPDATE force SET t_ns = 7 WHERE seq = 5500");
	assert_int_equal(values_of("force", &values, &err), -EINVAL);
	assert_null(values);
	assert_says(err.text, "table force, row 5500");
}

/* --- lengths --------------------------------------------------------------- */

/* Depths each 10 ms: 1 mm more each time, from 1 s on. */
static void put_frames(const char *frames)
{
	assert_int_equal(system("rm -rf a.rec"), 0);
	record("a.rec", "sim:clock=simulated", 700 * MS);
	change(DB, "DELETE FROM knots; DELETE FROM frames; "
		   "UPDATE tracker SET t_ns = 1000000000 + 10000000 * seq, x_mm = 0, "
		   "y_mm = 0, z_mm = 10.0 - seq, qw = 1, qx = 0, qy = 0, qz = 0");
	change(DB, frames);
}

static int lengths_of(struct incise_recording_length **rows, struct incise_error *err)
{
	struct incise_recording *recording = open_recording("a.rec");
	int n = incise_recording_lengths(recording, rows, err);

	incise_recording_close(recording);
	return n;
}

#define FRAME(seq, t, length, quality)                                          \
	"INSERT INTO frames VALUES(" #seq ", " #t ", " #t ", 0, 1, 1, " #length \
	", 0.1, 1.0, " #quality ", zeroblob(32));"

TEST(depths_are_interpolated, IN_FOLDER)
{
	struct incise_recording_length *rows;

	put_frames(FRAME(0, 900000000, 300.0, 0.9)    /* before the first depth */
		   FRAME(1, 1025000000, 310.0, 0.8)   /* half way from row 2 to row 3 */
		   FRAME(2, 1040000000, NULL, NULL)   /* no scalpel was found */
		   FRAME(3, 1050000000, 320.5, 0.7)   /* at row 5 itself */
		   FRAME(4, 1052500000, 321.0, 0.7)   /* a quarter on */
		   FRAME(5, 9000000000, 330.0, 0.9)); /* behind the last one */
	assert_int_equal(lengths_of(&rows, &err), 3);
	assert_int_equal(rows[0].t_ns, 1025000000);
	assert_true(rows[0].length_px == 310 && rows[0].quality == 0.8);
	/* sums of few binary digits */
	assert_true(fabs(rows[0].depth_mm + 7.5) < 1e-12);
	assert_true(fabs(rows[0].velocity_mm_s - 100) < 1e-9);
	assert_true(fabs(rows[1].depth_mm + 5) < 1e-12);
	assert_true(fabs(rows[2].depth_mm + 4.75) < 1e-12);
	free(rows);
}

/* No length has a depth across a gap in the tracker's records. */
TEST(gaps_are_left_out, IN_FOLDER)
{
	struct incise_recording_length *rows;

	put_frames("UPDATE tracker SET t_ns = t_ns + 200000000 WHERE seq > 5; " FRAME(
		0, 1055000000, 300.0, 0.9) FRAME(1, 1150000000, 300.0, 0.9)
			   FRAME(2, 1275000000, 301.0, 0.9));
	assert_int_equal(lengths_of(&rows, &err), 1);
	assert_true(rows[0].length_px == 301);
	free(rows);
}

TEST(impossible_lengths_are_refused, IN_FOLDER)
{
	static const char *const cases[] = {
		FRAME(0, 1025000000, 9e999, 0.9),
		FRAME(0, 1025000000, 300.0, 9e999),
		FRAME(0, -1, 300.0, 0.9),
		FRAME(0, 1025000000, 300.0, 0.9) "UPDATE tracker SET z_mm = 9e999",
		FRAME(0, 1925000000, 300.0, 0.9) "DELETE FROM tracker WHERE seq = 3",
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_recording_length *rows;
		struct incise_error err = {0};

		put_frames(cases[i]);
		if (lengths_of(&rows, &err) != -EINVAL || rows)
			fail_msg("case %zu: %s", i, err.text);
		assert_says(err.text, "a.rec: damaged");
	}
}

/* --- pairs of depths --------------------------------------------------------------------- */

#define CUTS "sim:clock=simulated,cut_s=2,pause_s=0.5,depth_mm=8"

/* A frame between each two records, 0.25 mm deeper than the middle of both. */
#define FRAMES                                                                          \
	"DELETE FROM knots; DELETE FROM frames; "                                       \
	"INSERT INTO frames SELECT a.seq, (a.t_ns + b.t_ns) / 2, b.t_ns, a.seq, 1, 0, " \
	"100.0, 0.1, 0.25 - (a.z_mm + b.z_mm) / 2, 0.9, zeroblob(32) FROM tracker a "   \
	"JOIN tracker b ON b.seq = a.seq + 1; "

static int pairs_of(struct incise_depth_pair **pairs, struct incise_error *err)
{
	struct incise_recording *recording = open_recording("a.rec");
	int n = incise_depth_pairs(recording, pairs, err);

	incise_recording_close(recording);
	return n;
}

TEST(frames_meet_the_tracker, IN_FOLDER)
{
	struct incise_depth_pair *pairs;
	double along = 0;
	int n;

	record("a.rec", CUTS, 0);
	assert_int_equal(pairs_of(&pairs, &err), 0); /* no camera */
	free(pairs);
	change("a.rec/recording.db", FRAMES);
	n = pairs_of(&pairs, &err);
	assert_int_equal(n, ask("a.rec/recording.db",
				"SELECT count(*) FROM frames WHERE depth_mm >= 1.25"));
	assert_true(n > 100);
	for (int i = 0; i < n; i++) {
		/* times are whole ns, and 1 ns is 1e-7 mm at most */
		assert_float_equal(pairs[i].camera_mm - pairs[i].tracker_mm, 0.25, 1e-6);
		if (i)
			assert_true(pairs[i].t_ns > pairs[i - 1].t_ns);
		along = fmax(along, hypot(pairs[i].place_mm[0] - pairs[0].place_mm[0],
					  pairs[i].place_mm[1] - pairs[0].place_mm[1]));
	}
	/* what the blade has gone along the surface while it was so deep */
	assert_float_equal(
		along,
		ask("a.rec/recording.db",
		    "SELECT max(x_mm) - min(x_mm) FROM tracker WHERE z_mm < -1"),
		1);
	free(pairs);
}

TEST(what_is_no_depth_is_left_out, IN_FOLDER)
{
	static const struct {
		const char *sql;
		int n; /* or a negative errno */
	} row[] = {
		{"UPDATE frames SET quality = 0.4", 0},
		{"UPDATE frames SET quality = NULL", 0},
		{"UPDATE frames SET depth_mm = NULL", 0},
		{"UPDATE frames SET depth_mm = 0.5", 0},
		{"UPDATE frames SET t_ns = t_ns + 100000000000", 0},
		{"UPDATE frames SET depth_mm = 9e999", -EINVAL},
		{"UPDATE tracker SET z_mm = 9e999 WHERE seq = 200", -EINVAL},
		{"DELETE FROM tracker WHERE seq = 200", -EINVAL},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct incise_depth_pair *pairs = (void *)1;
		char copy[60];
		int n;

		if (!i) {
			record("b.rec", CUTS, 0);
			change("b.rec/recording.db", FRAMES);
		}
		snprintf(copy, sizeof(copy), "rm -rf a.rec && cp -r b.rec a.rec");
		assert_int_equal(system(copy), 0);
		change("a.rec/recording.db", row[i].sql);
		n = pairs_of(&pairs, &err);
		if (n != row[i].n)
			fail_msg("row %zu: %d, %s", i, n, err.text);
		if (n < 0)
			assert_null(pairs);
		free(pairs);
	}
}
