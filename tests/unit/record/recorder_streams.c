// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder_streams.c: times of a whole recording against the truth. The
 * truth is the same virtual tracker without jitter, whose arrivals less the latency are the
 * times of acquisition.
 */
#include "recorded.h"
#include "../../../lib/record/read/recording.h"

struct errors {
	double rms_ms, worst_ms;
	double covered; /* share within 1.96 of the stated standard uncertainty */
	struct incise_stream tracker, force;
};

static int64_t *truth(const char *spec, int64_t duration_ns, int *n)
{
	struct incise_rig *rig = open_rig(spec);
	struct incise_tracker_sample samples[64];
	struct incise_tracker_info info;
	int64_t *t_ns = NULL;
	int64_t end_ns = incise_clock_now(incise_rig_clock(rig)) + duration_ns;

	*n = 0;
	incise_tracker_info(incise_rig_tracker(rig), &info);
	while (incise_clock_now(incise_rig_clock(rig)) < end_ns) {
		int taken;

		incise_clock_wait_until(incise_rig_clock(rig),
					incise_clock_now(incise_rig_clock(rig)) +
						100 * MS);
		taken = incise_tracker_read(incise_rig_tracker(rig), samples, 64);
		t_ns = realloc(t_ns, sizeof(*t_ns) * (size_t)(*n + taken + 1));
		for (int i = 0; i < taken; i++)
			t_ns[(*n)++] = samples[i].t_ns - info.latency_ns;
	}
	incise_rig_close(rig);
	return t_ns;
}

/* Of the best times afterwards, as export takes them. */
static void measure(double hz, double drift_ppm, double jitter_ms, double latency_ms,
		    int seed, double seconds, struct errors *out)
{
	struct incise_recording_line line;
	struct incise_recording *recording;
	struct incise_stream streams[INCISE_STREAMS_MAX];
	struct incise_error err = {0};
	int64_t duration_ns = (int64_t)(seconds * 1e9), *t_ns;
	char spec[300], still[300];
	double sum2 = 0;
	sqlite3_stmt *stmt;
	int n, rows = 0, covered = 0;

	for (int i = 0; i < 2; i++)
		snprintf(i ? still : spec, sizeof(spec),
			 "sim:clock=simulated,force_hz=100,tracker_hz=%g,"
			 "tracker_drift_ppm=%g,tracker_jitter_ms=%g,"
			 "tracker_latency_ms=%g,seed=%d",
			 hz, drift_ppm, i ? 0 : jitter_ms, latency_ms, seed);
	record("a.rec", spec, duration_ns);
	t_ns = truth(still, duration_ns, &n);
	recording = incise_recording_open("a.rec", &err);
	if (!recording || incise_recording_line(recording, "tracker", &line, &err) ||
	    incise_recording_streams(recording, streams, &err) != 2)
		fail_msg("%s", err.text);
	*out = (struct errors){.force = streams[0], .tracker = streams[1]};
	assert_int_equal(sqlite3_prepare_v2(recording->db,
					    "SELECT seq, t_ns FROM tracker ORDER BY seq",
					    -1, &stmt, NULL),
			 SQLITE_OK);
	while (sqlite3_step(stmt) == SQLITE_ROW && rows < n) {
		uint64_t seq = sqlite3_column_int64(stmt, 0);
		double error_ns =
			incise_recording_time(&line, seq, sqlite3_column_int64(stmt, 1)) -
			t_ns[seq];

		sum2 += error_ns * error_ns;
		out->worst_ms = fmax(out->worst_ms, fabs(error_ns) * 1e-6);
		covered += fabs(error_ns) <= 1.96 * incise_recording_time_sd(&line, seq);
		rows++;
	}
	sqlite3_finalize(stmt);
	incise_recording_close(recording);
	free(t_ns);
	assert_int_equal(system("rm -r a.rec"), 0);
	out->rms_ms = sqrt(sum2 / rows) * 1e-6;
	out->covered = (double)covered / rows;
}

/* Asked: 0.5 ms rms without stamps, and the uncertainty stated covers the error in 95 %. */
static void times_without_stamps_are_near_the_truth(void **state)
{
	static const struct {
		double hz, drift_ppm, jitter_ms, latency_ms;
	} cases[] = {
		{120, 50, 0.2, 4.2}, {60, -200, 7, 40}, {120, 200, 7, 4},
		{240, 200, 2, 40},   {240, -200, 7, 4}, /* up to 7 · 3 = 21 ms late */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double covered = 0;

		for (int seed = 1; seed <= 3; seed++) {
			struct errors errors;

			measure(cases[i].hz, cases[i].drift_ppm, cases[i].jitter_ms,
				cases[i].latency_ms, seed, 10, &errors);
			covered += errors.covered / 3;
			if (!(errors.rms_ms <= 0.5))
				fail_msg("case %zu, seed %d: %.3f ms rms", i, seed,
					 errors.rms_ms);
			/* 4 sd, once in 16000 */
			if (!(fabs(errors.tracker.drift_ppm - cases[i].drift_ppm) <=
			      4 * errors.tracker.drift_sd_ppm))
				fail_msg("case %zu, seed %d: drift %.2f +- %.2f ppm", i,
					 seed, errors.tracker.drift_ppm,
					 errors.tracker.drift_sd_ppm);
		}
		if (!(covered >= 0.95))
			fail_msg("case %zu: %.3f covered", i, covered);
	}
}

/* What is stamped is taken at its word: exact on the virtual rig. */
static void table_says_what_is_known(void **state)
{
	struct errors errors;
	const struct incise_stream *force = &errors.force, *tracker = &errors.tracker;

	measure(120, 200, 2, 20, 1, 20, &errors);
	assert_string_equal(force->name, "force");
	assert_true(force->stamped && force->nominal_hz == 100 && force->rows >= 2000);
	assert_true(force->lost == 0 && force->late == 0 && force->delay_ms == 0);
	assert_true(isnan(force->delay_sd_ms) && isnan(force->offset_sd_ms));
	/* times are whole ns */
	assert_true(fabs(force->rate_hz - 100) < 1e-5 && force->jitter_ms < 1e-5);
	assert_string_equal(tracker->name, "tracker");
	assert_true(!tracker->stamped && tracker->nominal_hz == 120);
	assert_true(tracker->delay_ms == 20 && isnan(tracker->delay_sd_ms));
	/* Lateness is half-normal: its sd is 2 ms · √(1 - 2/π) = 1.206 ms, and that of the
	 * sd over 2400 records some 2 %; 4 of them. */
	assert_true(fabs(tracker->jitter_ms - 1.206) < 0.1);
	assert_true(fabs(tracker->rate_hz - 120 * 1.0002) < 0.01);
	/* of 2400 the latest is 3.5 sd or so; one in 2400 · 1e-4 is above 4.9 */
	assert_true(tracker->jitter_max_ms > 5 && tracker->jitter_max_ms < 9.8);
	assert_true(tracker->offset_ms > 20 && tracker->offset_ms < 21);
	assert_true(tracker->offset_sd_ms > 0 && tracker->offset_sd_ms < 1);
	assert_string_equal(tracker->ended, "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(times_without_stamps_are_near_the_truth),
		IN_FOLDER(table_says_what_is_known),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
