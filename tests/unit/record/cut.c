// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of lib/record/read/cut.c; the stream of samples is tested by export.c too. */
#include "../unit.h"
#include "recorded.h"
#include "../../../lib/record/read/cut.h"
#include "../../../lib/record/read/depth.h"

TEST(hysteresis)
{
	static const struct {
		const char *what;
		double depth[8];
		const char *inside; /* as many as there are depths */
		int count;
	} cases[] = {
		{"in the air", {-5, -1, 0, 0.1, 0.2, 0.3}, "......", 0},
		{"one cut", {0, 0.2, 0.31, 5, 0.2, 0.1, 0.09, 0.2}, "..####..", 1},
		{"exactly the limits", {0.3, 0.3000001, 0.1, 0.0999999}, ".##.", 1},
		{"noise at the surface",
		 {0.25, 0.28, 0.32, 0.28, 0.25, 0.32, 0.15},
		 "..#####",
		 1},
		{"two cuts", {1, 0, 0.2, 1, 0}, "#..#.", 2},
		{"starts inside", {4, 4, 4}, "###", 1},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_cut_count cut = {0};

		for (size_t k = 0; k < strlen(cases[i].inside); k++)
			if (incise_cut_step(&cut, cases[i].depth[k]) !=
			    (cases[i].inside[k] == '#'))
				fail_msg("%s: step %zu", cases[i].what, k);
		assert_int_equal(cut.count, cases[i].count);
	}
}

#define DB "cut.rec/recording.db"

/* All samples inside cuts, by the stream. Returns how many. */
static int stream(struct incise_cut_sample *samples, int max)
{
	struct incise_recording *recording = incise_recording_open("cut.rec", &err);
	struct incise_cuts cuts;
	int n = 0, rc;

	succeeds(recording && !incise_cuts_open(&cuts, recording, &err));
	while ((rc = incise_cuts_next(&cuts, &samples[n], &err)) > 0)
		assert_true(++n < max);
	succeeds(!rc);
	incise_cuts_close(&cuts);
	incise_recording_close(recording);
	return n;
}

TEST(samples_are_interpolated, IN_FOLDER)
{
	struct incise_cut_sample s[20];
	double mm_s[4];
	int n;

	/*
	 * ms     1       11      21        56          120
	 * depth  1 ─────► 2 ─────► 3 ────► 3.5 ─ gap ─ 4
	 */
	record("cut.rec", "sim:clock=simulated", 100 * MS);
	change(DB,
	       "DELETE FROM knots; DELETE FROM force; DELETE FROM tracker;"
	       "INSERT INTO tracker SELECT column1, column2, column2, 0, 0, -column3, 1, "
	       "0, 0, 0, ' ', 1, 0 FROM (VALUES(0,1000000,1.0),(1,11000000,2.0),"
	       "(2,21000000,3.0),(3,56000000,3.5),(4,120000000,4.0));"
	       "INSERT INTO force VALUES(0,0,0),(1,1000000,1024),(2,3500000,2048),"
	       "(5,11000000,4095),(6,20999999,0),(7,56000000,7),(8,60000000,8),"
	       "(9,200000000,9);"
	       "UPDATE meta SET value=8 WHERE key='force_rows';"
	       "UPDATE meta SET value=5 WHERE key IN ('depth_rows', 'tracker_rows');"
	       "UPDATE meta SET value=100.0 WHERE key='force_zero_mV';");
	for (int i = 0; i < 4; i++) {
		char sql[80];

		snprintf(sql, sizeof(sql),
			 "SELECT velocity_mm_s FROM depth WHERE seq = %d", i);
		mm_s[i] = ask(DB, sql);
	}
	assert_true(mm_s[0] > mm_s[1] && mm_s[1] > 30 && mm_s[0] < 101);
	n = stream(s, 20);
	assert_int_equal(n,
			 4); /* not: before the first row, in the gap, after the last */
	assert_int_equal(s[0].t_ns, 1000000);
	assert_true(s[0].depth_mm == 1 && s[0].velocity_mm_s == mm_s[0]);
	assert_true(fabs(s[1].depth_mm - 1.25) < 1e-15 &&
		    fabs(s[1].velocity_mm_s - (0.75 * mm_s[0] + 0.25 * mm_s[1])) < 1e-12);
	assert_true(s[2].depth_mm == 2 && s[2].velocity_mm_s == mm_s[1]);
	assert_true(fabs(s[3].depth_mm - 3) < 1e-6 && s[3].depth_mm < 3);
	/* 1024 of 4096 codes over 5 V are 1250 mV */
	assert_true(fabs(s[0].force_N - (1250 - 100) / 1240.0) < 1e-15);
	assert_false(s[0].clipped || s[1].clipped);
	assert_true(s[2].clipped && s[3].clipped); /* both ends of the converter */
	for (int i = 0; i < n; i++)
		assert_int_equal(s[i].cut, 1);
}
