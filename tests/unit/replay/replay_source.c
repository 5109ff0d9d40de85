// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/replay/replay_source.c: what a recording of hand-written rows says at each
 * tick, compared with plain sums over the rows.
 */
#include "../unit.h"
#include "../record/recorded.h"
#include "../../../lib/replay/replay_source.h"

#define DB "known.rec/recording.db"
#define START_NS 10000000000LL /* of the hand-written rows */
#define FORCE_NS 100000LL
#define TRACKER_NS 8000000LL
#define RECORDS 120 /* records of the tracker: 0.96 s */
#define SAMPLES 9500

/* Rows with known values: force by its number, a blade that goes down evenly. */
#define ROWS                                                                           \
	"DELETE FROM knots; DELETE FROM force WHERE seq >= 9500;"                      \
	"DELETE FROM tracker WHERE seq >= 120;"                                        \
	"UPDATE meta SET value = 9500 WHERE key = 'force_rows';"                       \
	"UPDATE meta SET value = 120 WHERE key IN ('tracker_rows', 'depth_rows');"     \
	"UPDATE force SET t_ns = 10000000000 + seq * 100000, code = 1000 + seq % 977;" \
	"UPDATE tracker SET t_ns = 10000000000 + seq * 8000000, "                      \
	"arrival_ns = 10004000000 + seq * 8000000 + (seq * 7919 % 3000) * 1000, "      \
	"x_mm = seq * 0.5, y_mm = 1.5, z_mm = 2.0 - seq * 0.1, qw = 1.0, qx = 0.0, "   \
	"qy = 0.0, qz = 0.0;"

static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("known.rec", SHORT_SCRIPT, 1200 * MS);
	change(DB, ROWS);
	return 0;
}

static void open_source(struct incise_replay_source *source,
			struct incise_recording **recording, enum incise_replay_at at)
{
	*recording = incise_recording_open("known.rec", &err);
	succeeds(*recording &&
		 !incise_replay_source_open(source, *recording, at, NULL, &err));
}

static int64_t arrival(int seq)
{
	return START_NS + 4 * MS + seq * TRACKER_NS + seq * 7919 % 3000 * 1000;
}

/* Each pose is returned at the first tick that is not before it, and never again. */
TEST(poses_are_told_when_they_had_come)
{
	static const enum incise_replay_at ats[] = {INCISE_REPLAY_ARRIVAL,
						    INCISE_REPLAY_ACQUISITION};

	for (int k = 0; k < 2; k++) {
		struct incise_tracker_sample poses[32];
		struct incise_replay_source source;
		struct incise_recording *recording;
		int seq = 0;

		open_source(&source, &recording, ats[k]);
		assert_true(source.info.rate_hz == 120);
		assert_int_equal(source.info.latency_ns, k ? 0 : 4200000);
		assert_int_equal(source.first_ns, START_NS);
		/* force ends first */
		assert_int_equal(source.last_ns, k ? START_NS + (RECORDS - 1) * TRACKER_NS
						   : arrival(RECORDS - 1));
		for (int64_t t = START_NS; t < START_NS + 1100 * MS; t += MS) {
			int n = incise_replay_source_poses(&source, t, poses, 32, &err);

			assert_true(n >= 0);
			for (int i = 0; i < n; i++, seq++) {
				int64_t came =
					k ? START_NS + seq * TRACKER_NS : arrival(seq);

				assert_int_equal(poses[i].seq, seq);
				assert_int_equal(poses[i].t_ns, came);
				assert_true(came <= t && (seq == 0 || came > t - MS));
				assert_true(poses[i].position_mm[0] == seq * 0.5);
				assert_true(poses[i].quaternion[0] == 1);
				assert_int_equal(poses[i].status, ' ');
				assert_int_equal(poses[i].station, 1);
				assert_false(poses[i].button);
			}
		}
		assert_int_equal(seq, RECORDS);
		assert_int_equal(incise_replay_source_finish(&source, &err), 0);
		incise_replay_source_close(&source);
		incise_recording_close(recording);
	}
}

TEST(more_poses_than_there_is_room_wait)
{
	struct incise_tracker_sample poses[7];
	struct incise_replay_source source;
	struct incise_recording *recording;

	open_source(&source, &recording, INCISE_REPLAY_ARRIVAL);
	for (int seq = 0; seq < RECORDS;) {
		int n = incise_replay_source_poses(&source, INT64_MAX, poses, 7, &err);

		assert_int_equal(n, seq + 7 <= RECORDS ? 7 : RECORDS - seq);
		assert_int_equal(poses[0].seq, seq);
		seq += n;
	}
	incise_replay_source_close(&source);
	incise_recording_close(recording);
}

/* The mean over all rows that are nearest, by a sum over all numbers. */
TEST(force_is_the_mean_around_the_tick)
{
	static const int64_t periods[] = {MS, MS / 2, 3 * MS, 50000, 1700001};
	double zero = ask(DB, "SELECT value FROM meta WHERE key = 'force_zero_mV'");

	for (size_t k = 0; k < sizeof(periods) / sizeof(*periods); k++) {
		struct incise_replay_source source;
		struct incise_recording *recording;

		open_source(&source, &recording, INCISE_REPLAY_ARRIVAL);
		for (int64_t t = START_NS + periods[k]; t < START_NS + 970 * MS;
		     t += periods[k]) {
			int64_t from = t - periods[k] / 2, end = from + periods[k];
			struct incise_replay_measure m;
			double sum = 0;
			int n = 0;

			/* in whole rows, so that brute force is not slow */
			for (int64_t seq = (from - START_NS) / FORCE_NS - 1;
			     seq <= (end - START_NS) / FORCE_NS + 1; seq++) {
				int64_t at = START_NS + seq * FORCE_NS;

				if (seq < 0 || seq >= SAMPLES || at < from || at >= end)
					continue;
				sum += 1000 + seq % 977;
				n++;
			}
			assert_int_equal(incise_replay_source_measure(
						 &source, t, periods[k], &m, &err),
					 0);
			assert_int_equal(isnan(m.force_N), n == 0);
			/* rounding of some products and sums of a few newtons */
			if (n)
				assert_true(fabs(m.force_N - (sum / n * 5000 / 4096 -
							      zero) / 1240) < 1e-12);
			assert_false(m.clipped);
		}
		incise_replay_source_close(&source);
		incise_recording_close(recording);
	}
}

TEST(depth_and_cuts_are_those_of_the_table)
{
	struct incise_replay_source source;
	struct incise_recording *recording;
	struct incise_replay_measure m;

	open_source(&source, &recording, INCISE_REPLAY_ARRIVAL);
	for (int64_t t = START_NS + MS; t < START_NS + 970 * MS; t += MS) {
		double depth = (t - START_NS) / (double)TRACKER_NS * 0.1 - 2;

		assert_int_equal(incise_replay_source_measure(&source, t, MS, &m, &err),
				 0);
		if (t >= START_NS + (RECORDS - 1) * TRACKER_NS) {
			assert_true(isnan(m.depth_mm) && m.cut == 0);
			continue;
		}
		assert_true(fabs(m.depth_mm - depth) < 1e-9);
		/* starts above 0.3 mm; the tick on it may fall to either side */
		if (fabs(depth - 0.3) > 1e-6)
			assert_int_equal(m.cut, depth > 0.3);
	}
	incise_replay_source_close(&source);
	incise_recording_close(recording);
}

/* Another calibration; clipped samples; a gap in each stream; best times by a line. */
TEST(gaps_clips_and_lines)
{
	struct incise_calibration calibration;
	struct incise_replay_source source;
	struct incise_recording *recording;
	struct incise_tracker_sample pose;
	struct incise_replay_measure m;

	change(DB,
	       "UPDATE force SET code = 4095 WHERE seq = 3000;"
	       "DELETE FROM force WHERE seq BETWEEN 4000 AND 4099;"
	       "DELETE FROM tracker WHERE seq BETWEEN 50 AND 59;"
	       "DELETE FROM depth WHERE seq BETWEEN 50 AND 59;"
	       "UPDATE meta SET value = 9400 WHERE key = 'force_rows';"
	       "UPDATE meta SET value = 110 WHERE key IN ('tracker_rows', "
	       "'depth_rows');"
	       /* 0.25 ms earlier than the rows say, and 8.001 ms apart */
	       "INSERT INTO knots VALUES('tracker', 0, 0, 9999750000, 1000.0, 1);"
	       "INSERT INTO knots VALUES('tracker', 1, 119, 10951869000, 1000.0, 0);");
	incise_calibration_nominal(&calibration);
	calibration.force_mV_N = 620;
	calibration.force_zero_mV = 100;
	recording = incise_recording_open("known.rec", &err);
	assert_non_null(recording);
	assert_int_equal(incise_replay_source_open(&source, recording,
						   INCISE_REPLAY_ACQUISITION,
						   &calibration, &err),
			 0);
	assert_int_equal(source.first_ns, 9999750000);
	assert_int_equal(source.origin_ns, START_NS);
	for (int64_t t = START_NS + MS; t < START_NS + 940 * MS; t += MS) {
		int64_t ms = (t - START_NS) / MS;
		/* between records 49 and 60: 88 ms without one */
		bool gap = t >= 9999750000 + 49 * 8001000LL &&
			   t < 9999750000 + 60 * 8001000LL;

		assert_int_equal(incise_replay_source_measure(&source, t, MS, &m, &err),
				 0);
		assert_int_equal(m.clipped, ms == 300);
		assert_int_equal(isnan(m.force_N), ms > 400 && ms < 410);
		assert_int_equal(isnan(m.depth_mm), gap);
		if (gap)
			assert_int_equal(m.cut, 0);
		else
			assert_true(fabs(m.depth_mm -
					 ((t - 9999750000) / 8001000. * 0.1 - 2)) < 1e-6);
		if (ms == 100) { /* samples 995 … 1004 */
			double sum = 0;

			for (int i = 995; i < 1005; i++)
				sum += (1000 + i % 977) / 10.;
			assert_true(fabs(m.force_N - (sum * 5000 / 4096 - 100) / 620) <
				    1e-12);
		}
	}
	for (int seq = 0; seq < RECORDS; seq += seq == 49 ? 11 : 1) {
		assert_int_equal(incise_replay_source_poses(&source, INT64_MAX, &pose, 1,
							    &err),
				 1);
		assert_int_equal(pose.seq, seq);
		/* a line of whole nanoseconds: no rounding but of its slope */
		assert_true(llabs(pose.t_ns - (9999750000 + seq * 8001000LL)) <= 1);
	}
	assert_int_equal(incise_replay_source_finish(&source, &err), 0);
	incise_replay_source_close(&source);
	incise_recording_close(recording);
	change(DB,
	       "DELETE FROM knots; DELETE FROM force; DELETE FROM tracker;"
	       "DELETE FROM depth;"
	       "UPDATE meta SET value = 0 WHERE key IN ('force_rows', 'tracker_rows', "
	       "'depth_rows');");
}

/* Damage and its message: on opening, or while reading. */
TEST(no_damaged_row_is_believed)
{
	static const struct {
		const char *sql, *message;
		int code;
	} cases[] = {
		{"SELECT 1", NULL, 0},
		{"UPDATE tracker SET arrival_ns = 9000000000 WHERE seq = 40",
		 "arrival_ns", EINVAL},
		{"UPDATE tracker SET arrival_ns = -1 WHERE seq = 0", "arrival_ns",
		 EINVAL},
		{"UPDATE tracker SET arrival_ns = 9000000000000000000 WHERE seq = 119",
		 NULL, EINVAL},
		{"UPDATE tracker SET arrival_ns = 2000000000000000 WHERE seq = 119", NULL,
		 EINVAL},
		{"UPDATE tracker SET x_mm = 9e999 WHERE seq = 3", "stream tracker",
		 EINVAL},
		{"UPDATE tracker SET seq = -5 WHERE seq = 0", NULL, EINVAL},
		{"UPDATE tracker SET t_ns = 1 WHERE seq = 9", "row 9", EINVAL},
		{"DELETE FROM tracker WHERE seq = 119", "119 rows of 120", EINVAL},
		{"DELETE FROM tracker; UPDATE meta SET value = 0 WHERE key = "
		 "'tracker_rows'",
		 "no pose", ENODATA},
		{"UPDATE force SET code = 4096 WHERE seq = 9499", "force", EINVAL},
		{"UPDATE force SET code = -1 WHERE seq = 7", "force", EINVAL},
		{"DELETE FROM tracker WHERE seq = 60", "119 rows of 120", EINVAL},
		{"UPDATE meta SET value = 0.0 WHERE key = 'tracker_hz'", "tracker_hz",
		 EINVAL},
		{"UPDATE meta SET value = 'x' WHERE key = 'tracker_latency_ns'",
		 "tracker_latency_ns", EINVAL},
		{"DELETE FROM meta WHERE key = 'tracker_hz'", "tracker_hz", EINVAL},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_tracker_sample pose;
		struct incise_replay_measure m;
		struct incise_replay_source source;
		struct incise_recording *recording;
		struct incise_error err = {0};
		int rc;

		assert_int_equal(nftw("known.rec", remove_entry, 8, FTW_DEPTH | FTW_PHYS),
				 0);
		record("known.rec", SHORT_SCRIPT, 1200 * MS);
		change(DB, ROWS);
		change(DB, cases[k].sql);
		recording = incise_recording_open("known.rec", &err);
		assert_non_null(recording);
		rc = incise_replay_source_open(&source, recording, INCISE_REPLAY_ARRIVAL,
					       NULL, &err);
		if (!rc) {
			for (int64_t t = START_NS; rc >= 0 && t < START_NS + 300 * MS;
			     t += MS) {
				rc = incise_replay_source_poses(&source, t, &pose, 1,
								&err);
				if (rc >= 0)
					rc = incise_replay_source_measure(&source, t, MS,
									  &m, &err);
			}
			if (rc >= 0)
				rc = incise_replay_source_finish(&source, &err);
			incise_replay_source_close(&source);
		}
		if (rc != -cases[k].code)
			fail_msg("%s: %d, %s", cases[k].sql, rc, err.text);
		if (rc)
			assert_says(err.text, cases[k].message);
		incise_recording_close(recording);
	}
}

GROUP(record_once, leave_folder);
