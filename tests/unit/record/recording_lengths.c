// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/recording_lengths.c: lengths of pictures beside the depth at their time, also
 * where there is none, and where somebody wrote into the tables what cannot be.
 */
#include "recorded.h"

#define DB "a.rec/recording.db"

/* Depths each 10 ms: 1 mm and 5 mm/s more each time, from 1 s on, of a tracker at rest. */
static void plant(const char *frames)
{
	assert_int_equal(system("rm -rf a.rec"), 0);
	record("a.rec", "sim:clock=simulated", 700 * MS);
	change(DB, "DELETE FROM knots; DELETE FROM frames; "
		   "UPDATE depth SET t_ns = 1000000000 + 10000000 * seq, "
		   "depth_mm = 1.0 * seq - 10, velocity_mm_s = 5.0 * seq");
	change(DB, frames);
}

static int lengths(struct incise_recording_length **rows, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open("a.rec", err);
	int n;

	assert_non_null(recording);
	n = incise_recording_lengths(recording, rows, err);
	incise_recording_close(recording);
	return n;
}

#define FRAME(seq, t, length, quality)                                          \
	"INSERT INTO frames VALUES(" #seq ", " #t ", " #t ", 0, 1, 1, " #length \
	", 0.1, 1.0, " #quality ");"

static void depths_are_interpolated(void **state)
{
	struct incise_recording_length *rows;
	struct incise_error err = {0};

	plant(FRAME(0, 900000000, 300.0, 0.9)	 /* before the first depth */
	      FRAME(1, 1025000000, 310.0, 0.8)	 /* half way from row 2 to row 3 */
	      FRAME(2, 1040000000, NULL, NULL)	 /* no scalpel was found */
	      FRAME(3, 1050000000, 320.5, 0.7)	 /* at row 5 itself */
	      FRAME(4, 1052500000, 321.0, 0.7)	 /* a quarter on */
	      FRAME(5, 9000000000, 330.0, 0.9)); /* behind the last one */
	assert_int_equal(lengths(&rows, &err), 3);
	assert_int_equal(rows[0].t_ns, 1025000000);
	assert_true(rows[0].length_px == 310 && rows[0].quality == 0.8);
	/* sums of few binary digits */
	assert_true(fabs(rows[0].depth_mm + 7.5) < 1e-12);
	assert_true(fabs(rows[0].velocity_mm_s - 12.5) < 1e-12);
	assert_true(fabs(rows[1].depth_mm + 5) < 1e-12);
	assert_true(fabs(rows[2].depth_mm + 4.75) < 1e-12);
	free(rows);
}

/* Nothing is told across a gap in the tracker's records. */
static void gaps_are_left_out(void **state)
{
	struct incise_recording_length *rows;
	struct incise_error err = {0};

	plant("UPDATE depth SET t_ns = t_ns + 200000000 WHERE seq > 5; " FRAME(
		0, 1055000000, 300.0, 0.9) FRAME(1, 1150000000, 300.0, 0.9)
		      FRAME(2, 1275000000, 301.0, 0.9));
	assert_int_equal(lengths(&rows, &err), 1);
	assert_true(rows[0].length_px == 301);
	free(rows);
}

static void what_cannot_be_is_refused(void **state)
{
	static const char *const cases[] = {
		FRAME(0, 1025000000, 'long', 0.9),
		FRAME(0, 1025000000, 9e999, 0.9),
		FRAME(0, 1025000000, 300.0, 'good'),
		FRAME(0, 'now', 300.0, 0.9),
		FRAME(0, 1025000000, 300.0, 0.9) "UPDATE depth SET depth_mm = 9e999",
		FRAME(0, 1925000000, 300.0, 0.9) "DELETE FROM depth WHERE seq = 3",
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_recording_length *rows;
		struct incise_error err = {0};

		plant(cases[i]);
		if (lengths(&rows, &err) != -EINVAL || rows)
			fail_msg("case %zu: %s", i, err.text);
		assert_non_null(strstr(err.text, "a.rec: damaged"));
	}
}

static void old_recordings_have_no_pictures(void **state)
{
	struct incise_recording_length *rows;
	struct incise_error err = {0};

	record("a.rec", "sim:clock=simulated", 700 * MS);
	change(DB, TO_FORM_1);
	assert_int_equal(lengths(&rows, &err), -EINVAL);
	assert_non_null(strstr(err.text, "older form"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(depths_are_interpolated, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(gaps_are_left_out, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(what_cannot_be_is_refused, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(old_recordings_have_no_pictures,
						enter_folder, leave_folder),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
