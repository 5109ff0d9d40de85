// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder_rows.c: times of a whole recording against the truth, which
 * is the same virtual tracker without jitter, whose arrivals less the latency are the times of
 * acquisition; the last second before a trigger, and no more; a camera, one that dies, and one
 * whose file is removed.
 */
#include "../unit.h"
#include "recorded.h"
#include <incise/backend.h>
#include <incise/verify.h>
#include "../../../lib/record/read/rows.h"

#define DB "a.rec/recording.db"
#define SIM "sim:clock=simulated"

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
	struct incise_row_times times;
	struct incise_recording *recording;
	struct incise_stream streams[INCISE_STREAMS_MAX];
	int64_t duration_ns = (int64_t)(seconds * 1e9), *t_ns;
	char spec[300], still[300];
	double sum2 = 0;
	struct incise_source source;
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
	succeeds(recording &&
		 !incise_row_times_open(&times, recording, "tracker", &err) &&
		 incise_recording_streams(recording, streams, &err) == 2);
	*out = (struct errors){.force = streams[0], .tracker = streams[1]};
	succeeds(!incise_source_open(&source, recording, INCISE_LEDGER_TRACKER, &err));
	while (incise_source_next(&source, &err) > 0)
		for (size_t k = 0; k < source.batch.n && rows < n; k++, rows++) {
			uint64_t seq = source.batch.column[0].i[k];
			double error_ns =
				incise_row_times_line(&times, seq,
						      source.batch.column[1].i[k]) -
				t_ns[seq];

			sum2 += error_ns * error_ns;
			out->worst_ms = fmax(out->worst_ms, fabs(error_ns) * 1e-6);
			covered += fabs(error_ns) <=
				   1.96 * incise_row_times_line_sd(&times, seq);
		}
	incise_source_close(&source);
	incise_row_times_close(&times);
	incise_recording_close(recording);
	free(t_ns);
	assert_int_equal(system("rm -r a.rec"), 0);
	out->rms_ms = sqrt(sum2 / rows) * 1e-6;
	out->covered = (double)covered / rows;
}

/* Required: 0.5 ms rms without timestamps, and 95 % of errors within the stated uncertainty. */
TEST(times_without_timestamps_are_near_the_truth, IN_FOLDER)
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

/* Timestamps are used as they are: exact on the virtual rig. */
TEST(table_says_what_is_known, IN_FOLDER)
{
	struct errors errors;
	const struct incise_stream *force = &errors.force, *tracker = &errors.tracker;

	measure(120, 200, 2, 20, 1, 20, &errors);
	assert_string_equal(force->name, "force");
	assert_true(force->timestamped && force->nominal_hz == 100 &&
		    force->rows >= 2000);
	assert_true(force->lost == 0 && force->late == 0 && force->delay_ms == 0);
	assert_true(isnan(force->delay_sd_ms) && isnan(force->offset_sd_ms));
	/* times are whole ns */
	assert_true(fabs(force->rate_hz - 100) < 1e-5 && force->jitter_ms < 1e-5);
	assert_string_equal(tracker->name, "tracker");
	assert_true(!tracker->timestamped && tracker->nominal_hz == 120);
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

/* --- pretrigger ---------------------------------------------------------------------------- */

TEST(last_second_is_there, IN_FOLDER)
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
		struct incise_recorder *rec;
		double before_ms, after_ms;

		incise_calibration_nominal(&calibration);
		calibration.force_zero_mV = 180;
		rec = start_recorder_by("a.rec", rig, setup);
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

/* --- camera -------------------------------------------------------------------------- */

static const struct incise_camera_ops *real;
static struct incise_camera_ops ops;
static uint64_t dies_at, skips_at, silent_from, silent_to;

static int faulty(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	int rc = real->read(camera, frame);

	if (rc == 1 && frame->seq >= silent_from && frame->seq < silent_to)
		return 0;
	if (rc == 1 && frame->seq >= dies_at)
		return -ENODEV;
	return rc == 1 && frame->seq == skips_at ? 0 : rc;
}

static int why(struct incise_camera *camera, char *text, size_t size)
{
	return snprintf(text, size, "the camera was pulled out; plug it in");
}

static struct incise_rig *open_camera(const char *spec)
{
	struct incise_rig *rig;
	struct incise_camera *camera;

	if (!has_frames()) {
		print_message(
			"frames_mkv.so was not built: libavformat-dev is missing\n");
		skip();
	}
	rig = incise_rig_open(spec, BOTH | INCISE_RIG_CAMERA, &err);

	succeeds(rig);
	camera = incise_rig_camera(rig);
	real = camera->ops;
	ops = *real;
	ops.read = faulty;
	ops.cause = why;
	camera->ops = &ops;
	dies_at = skips_at = silent_from = silent_to = UINT64_MAX;
	return rig;
}

/* Ends it; the streams as they were at the end. */
static void end(struct incise_recorder *recorder, struct incise_rig *rig,
		struct incise_stream streams[INCISE_STREAMS_MAX])
{
	struct incise_recorder_stats stats;

	succeeds(!incise_recorder_end(recorder, &err));
	incise_recorder_stats(recorder, &stats);
	assert_int_equal(stats.n_streams, 3);
	memcpy(streams, stats.streams, sizeof(stats.streams));
	assert_string_equal(streams[2].name, "camera");
	succeeds(!incise_recorder_close(recorder, &err));
	incise_rig_close(rig);
}

static void verified(bool complete)
{
	struct incise_verify_report report;

	succeeds(!incise_verify("a.rec", NULL, &report, &err));
	assert_int_equal(report.complete, complete);
	assert_true(report.intact);
}

TEST(frames_are_rows, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_recorder *recorder = start_recorder_by(
		"a.rec", rig, (struct incise_recorder_setup){.armed = false});
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 1000 * MS, NULL), 0);
	end(recorder, rig, streams);
	/* 50 Hz for a second, from its first frame at 0 */
	assert_in_range(streams[2].rows, 50, 51);
	assert_int_equal(streams[2].lost, 0);
	assert_int_equal(ask(DB, "SELECT count(*) FROM frames"), streams[2].rows);
	assert_int_equal(ask(DB, "SELECT max(seq) - min(seq) + 1 FROM frames"),
			 streams[2].rows);
	assert_int_equal(ask(DB, "SELECT max(t_ns) - min(t_ns) FROM frames"),
			 (streams[2].rows - 1) * 20 * MS);
	verified(true);
}

static void doubt(const struct incise_camera *camera, struct incise_camera_info *info)
{
	real->info(camera, info);
	info->clock_ns = 4 * MS;
	strcpy(info->note, "its clock drifts");
}

/* The drift of a camera's clock is part of the uncertainty, and its note is kept. */
TEST(camera_with_a_doubtful_clock, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_calibration calibration;
	struct incise_stream streams[INCISE_STREAMS_MAX];
	struct incise_recording *recording;
	struct incise_recorder *recorder;

	incise_calibration_nominal(&calibration);
	calibration.camera_delay_sd_ms = 3;
	ops.info = doubt;
	recorder = start_recorder_by("a.rec", rig,
				     (struct incise_recorder_setup){
					     .armed = false,
					     .calibration = &calibration,
				     });
	assert_int_equal(poll_for(recorder, rig, 500 * MS, NULL), 0);
	end(recorder, rig, streams);
	recording = incise_recording_open("a.rec", &err);
	succeeds(recording && incise_recording_streams(recording, streams, &err) == 3);
	incise_recording_close(recording);
	assert_true(fabs(streams[2].offset_sd_ms - 5) < 1e-6);
	assert_string_equal(streams[2].note, "its clock drifts");
	assert_string_equal(streams[0].note, "");
	verified(true);
}

/* The other streams continue; all earlier frames are there. */
TEST(camera_that_dies, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_recorder *recorder = start_recorder_by(
		"a.rec", rig, (struct incise_recorder_setup){.armed = false});
	struct incise_stream streams[INCISE_STREAMS_MAX];

	dies_at = 20;
	assert_int_equal(poll_for(recorder, rig, 1000 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_int_equal(streams[2].rows, 20);
	assert_string_equal(streams[2].ended, "the camera was pulled out; plug it in");
	assert_in_range(streams[0].rows, 10000, 10001);
	assert_string_equal(streams[0].ended, "");
	assert_int_equal(ask(DB,
			     "SELECT count(*) FROM events WHERE kind = 'failed' AND "
			     "text = 'camera: the camera was pulled out; plug it in'"),
			 1);
	/* what it would still have given is not there */
	verified(false);
}

/* A silent camera shoots nothing, so its numbers have no gap. 10 Hz; silence is 2 s. */
TEST(silent_camera, WITH_MODULES)
{
	static const struct {
		uint64_t from, to;
		int events;
		bool ended;
		uint64_t lost;
	} cases[] = {
		{10, 28, 0, false, 18},	       {10, 32, 2, false, 22},
		{10, UINT64_MAX, 1, true, 0},  {0, UINT64_MAX, 1, true, 0},
		{40, UINT64_MAX, 0, false, 0}, /* 1 s before the end */
		{0, 12, 0, false, 11},	       /* begins late */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_camera(SIM ",camera_hz=10");
		struct incise_recorder *recorder = start_recorder_by(
			"a.rec", rig, (struct incise_recorder_setup){.armed = false});
		struct incise_stream streams[INCISE_STREAMS_MAX];

		silent_from = cases[i].from;
		silent_to = cases[i].to;
		assert_int_equal(poll_for(recorder, rig, 5000 * MS, NULL), 0);
		end(recorder, rig, streams);
		assert_int_equal(ask(DB,
				     "SELECT count(*) FROM events WHERE kind = 'silent'"),
				 cases[i].events);
		assert_int_equal(*streams[2].ended != 0, cases[i].ended);
		assert_int_equal(streams[2].lost, cases[i].lost);
		verified(!cases[i].ended && cases[i].to == UINT64_MAX);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

TEST(lost_frame_is_counted, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_recorder *recorder = start_recorder_by(
		"a.rec", rig, (struct incise_recorder_setup){.armed = false});
	struct incise_stream streams[INCISE_STREAMS_MAX];

	skips_at = 10;
	assert_int_equal(poll_for(recorder, rig, 600 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_int_equal(streams[2].lost, 1);
	assert_int_equal(ask(DB, "SELECT value FROM meta WHERE key = 'frames_lost'"), 1);
	verified(false);
}

TEST(armed_camera_begins_with_the_trigger, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_recorder *recorder = start_recorder_by(
		"a.rec", rig, (struct incise_recorder_setup){.armed = true});
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 1000 * MS, NULL), 0);
	incise_recorder_trigger(recorder);
	assert_int_equal(poll_for(recorder, rig, 500 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_in_range(streams[2].rows, 25, 26);
	assert_int_equal(streams[2].lost, 0);
	verified(true);
}

TEST(never_triggered_is_empty_and_whole, WITH_MODULES)
{
	struct incise_rig *rig = open_camera(SIM);
	struct incise_recorder *recorder = start_recorder_by(
		"a.rec", rig, (struct incise_recorder_setup){.armed = true});
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 700 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_int_equal(streams[2].rows, 0);
	verified(true);
}

/* While a device was opened, the other one's samples waited: they are of the time before. */
TEST(samples_from_before_are_left_out, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_recorder *rec;
	static const char *const tables[] = {"force", "tracker"};

	incise_clock_wait_until(clock, incise_clock_now(clock) + 700 * MS);
	rec = start_recorder("a.rec", rig);
	assert_int_equal(poll_for(rec, rig, 500 * MS, &err), 0);
	assert_int_equal(incise_recorder_close(rec, &err), 0);
	for (int i = 0; i < 2; i++) {
		char sql[120];
		double before_ms;

		snprintf(sql, sizeof(sql),
			 "SELECT (SELECT t_ns FROM events WHERE kind = 'start') - "
			 "min(t_ns) FROM %s",
			 tables[i]);
		before_ms = ask(DB, sql) / MS;
		/* A tenth of a second, the delay of a pose, and a period. */
		if (!(before_ms <= 120))
			fail_msg("%s: %.1f ms before", tables[i], before_ms);
	}
	assert_int_equal(ask(DB, "SELECT sum(lost) FROM streams"), 0);
	incise_rig_close(rig);
}
