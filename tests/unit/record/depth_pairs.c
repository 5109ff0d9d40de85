// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/record/read/depth_pairs.c: pictures are put into a recording of the virtual rig by SQL, half
 * way between records of the tracker, where the depth is known by hand.
 */
#include "recorded.h"
#include <incise/depth_pairs.h>

#define SIM "sim:clock=simulated,cut_s=2,pause_s=0.5,depth_mm=8"

/* A picture between each two records, 0.25 mm deeper than the middle of both. */
#define PICTURES                                                                          \
	"DELETE FROM knots; DELETE FROM frames; "                                         \
	"INSERT INTO frames SELECT a.seq, (a.t_ns + b.t_ns) / 2, b.t_ns, a.seq, 1, 0, "   \
	"100.0, 0.1, 0.25 - (a.z_mm + b.z_mm) / 2, 0.9 FROM tracker a JOIN tracker b ON " \
	"b.seq = a.seq + 1; "

static int pairs_of(struct incise_depth_pair **pairs, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open("a.rec", err);
	int n;

	assert_non_null(recording);
	n = incise_depth_pairs(recording, pairs, err);
	incise_recording_close(recording);
	return n;
}

static void pictures_meet_the_tracker(void **state)
{
	struct incise_depth_pair *pairs;
	struct incise_error err = {0};
	double along = 0;
	int n;

	record("a.rec", SIM, 0);
	assert_int_equal(pairs_of(&pairs, &err), 0); /* no camera */
	free(pairs);
	change("a.rec/recording.db", PICTURES);
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

static void what_is_no_depth_is_left_out(void **state)
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
		{"UPDATE frames SET depth_mm = 'deep'", -EINVAL},
		{"UPDATE tracker SET z_mm = 9e999 WHERE seq = 200", -EINVAL},
		{"DELETE FROM tracker WHERE seq = 200", -EINVAL},
		{TO_FORM_1, 0},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct incise_depth_pair *pairs = (void *)1;
		struct incise_error err = {0};
		char copy[60];
		int n;

		if (!i) {
			record("b.rec", SIM, 0);
			change("b.rec/recording.db", PICTURES);
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(pictures_meet_the_tracker),
		cmocka_unit_test(what_is_no_depth_is_left_out),
	};

	return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
