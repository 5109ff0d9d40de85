// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/capture.c: whole captures of the virtual rig in simulated time, and verdicts on
 * results that were made by hand.
 */
#include "../unit.h"
#include <incise/capture.h>
#include "../../../driver/uapi/incise_stepper.h"
#include "recorded.h"
#include <signal.h>

#define S 1000000000LL
#define SIM "sim:clock=simulated,cut_s=1,pause_s=0.6"

static struct incise_calibration calibration;
static struct incise_capture_options options;
static struct incise_capture_result result;
static struct incise_rig *rig;
static char warnings[4000];

static void keep_warning(void *context, const char *text)
{
	size_t n = strlen(warnings);

	(void)context;
	snprintf(warnings + n, sizeof(warnings) - n, "%s\n", text);
}

static int start(void **state)
{
	incise_calibration_nominal(&calibration);
	options = (struct incise_capture_options){.recorder.calibration = &calibration,
						  .warn = keep_warning};
	*warnings = 0;
	rig = incise_rig_open(SIM, BOTH, NULL);
	return enter_folder(state);
}

static int stop(void **state)
{
	incise_rig_close(rig);
	incise_wall_free(result.wall);
	result.wall = NULL;
	return leave_folder(state);
}

#define ON_RIG start, stop

static int run(void)
{
	return incise_capture_run("a.rec", rig, &options, &result, &err);
}

static double count_forces(void)
{
	return ask("a.rec/recording.db", "SELECT count(*) FROM force");
}

/* --- a whole capture --------------------------------------------------------------------- */

TEST(a_duration_ends_it, ON_RIG)
{
	options.duration_s = 1.234;
	succeeds(!run());
	assert_true(fabs(result.seconds - 1.234) < 1e-9);
	assert_int_equal(result.start_ns, S); /* where its clock starts */
	assert_int_equal(result.early.code, 0);
	assert_null(result.wall);
	/* 10 kHz, and one more at the very end of it. */
	assert_true(result.stats.force == 12340 || result.stats.force == 12341);
	assert_true(count_forces() == (double)result.stats.force);
	assert_int_equal(incise_capture_judge("a.rec", &options, &result, &err), 0);
}

TEST(the_virtual_cuts_end_it, ON_RIG)
{
	succeeds(!run());
	/* 14 cuts of 1 s, 15 pauses of 0.6 s */
	assert_true(fabs(result.seconds - 23) < 1e-9);
}

struct steps {
	int n, last;
	volatile sig_atomic_t stop;
	int code;
	bool armed, recorded;
	double planned_s, left_s; /* left_s: the first that was known */
};

/* At the last step: trigger if it waits, else stop or fail. */
static int take_step(void *context, const struct incise_capture_state *state,
		     struct incise_error *err)
{
	struct steps *steps = context;

	steps->armed |= state->armed;
	steps->planned_s = state->planned_s;
	if (isnan(steps->left_s))
		steps->left_s = state->left_s;
	if (!state->armed)
		steps->recorded = true;
	if (++steps->n != steps->last)
		return 0;
	if (state->armed)
		incise_recorder_trigger(state->recorder);
	else
		steps->stop = SIGINT;
	return steps->code ? incise_error_set(err, steps->code, "no more") : 0;
}

static struct steps steps;

static void use_steps(struct steps use)
{
	steps = use;
	steps.left_s = NAN;
	options.step = take_step;
	options.stop = &steps.stop;
	options.context = &steps;
}

TEST(a_stop_ends_it_whole, ON_RIG)
{
	use_steps((struct steps){.last = 50});
	succeeds(!run());
	assert_int_equal(steps.n, 50);
	assert_true(fabs(result.seconds - 0.5) < 1e-9);
	assert_true(fabs(steps.planned_s - 23) < 1e-9);
	assert_true(count_forces() == (double)result.stats.force);
}

TEST(a_step_that_fails_ends_it_whole, ON_RIG)
{
	use_steps((struct steps){.last = 60, .code = EPERM});
	assert_error(run(), EPERM, &err, "no more");
	assert_true(count_forces() >= 6000);
}

/* --- triggers ------------------------------------------------------------------------------ */

TEST(a_step_triggers, ON_RIG)
{
	options.recorder.trigger_button = true;
	options.duration_s = 1;
	use_steps((struct steps){.last = 250});
	succeeds(!run());
	assert_true(steps.armed && steps.recorded);
	/* The second before it, and the poll in which it is seen. */
	assert_true(fabs(result.seconds - 2) < 1e-9);
	assert_int_equal(result.start_ns, 251 * POLL_NS);
	assert_true(fabs(steps.planned_s - 1) < 1e-9);
}

TEST(without_a_trigger_it_leaves_nothing, ON_RIG)
{
	options.recorder.trigger_force_N = 100;
	assert_error(run(), ECANCELED, &err, "a.rec: ", "never triggered");
	assert_true(result.stats.armed && !result.seconds);
	assert_int_equal(access("a.rec", F_OK), -1);
	assert_int_equal(access("a.rec.part", F_OK), -1);
}

TEST(a_time_triggers_exactly, ON_RIG)
{
	options.recorder.clock_source = "sim:1800000000";
	options.duration_s = 1;
	succeeds(!incise_capture_start_at(&options, "2027-01-15T08:00:05.1234TAI", &err));
	use_steps((struct steps){0});
	succeeds(!run());
	assert_true(ask("a.rec/recording.db",
			"SELECT t_ns FROM events WHERE kind = 'trigger'") ==
		    5123400000.0);
	assert_int_equal(result.start_ns, 4123400000LL);
	assert_true(steps.left_s > 4 && steps.left_s < 4.1234);
	assert_non_null(result.wall);
}

TEST(times_that_cannot_be, ON_RIG)
{
	succeeds(!incise_capture_start_at(&options, "2020-01-01T00:00:00Z", &err));
	assert_error(run(), EINVAL, &err, "--start-at", "simulated", "--clock-source");
	options.recorder.clock_source = "none";
	assert_error(run(), EINVAL, &err, "--start-at", "no wall time");
	options.recorder.clock_source = "sim";
	assert_error(run(), EINVAL, &err, "--start-at", "in the past");
	assert_int_equal(access("a.rec", F_OK), -1);
}

TEST(texts_of_times)
{
	static const struct {
		const char *text;
		int64_t ns; /* -1: refused */
		bool tai;
	} cases[] = {
		{"1970-01-01T00:00:00Z", 0, false},
		{"2027-01-15T08:00:10.5TAI", 1800000010500000000LL, true},
		{"2027-01-15T08:00:10.1234567899Z", 1800000010123456789LL, false},
		{"2027-01-15T08:00:10", -1, false},
		{"2027-01-15T08:00:10.Z", -1, false},
		{"2027-01-15T08:00:10Zulu", -1, false},
		{"2027-02-30T08:00:10Z", -1, false},
		{"1969-12-31T23:59:59Z", -1, false},
		{"2200-01-01T00:00:00Z", -1, false},
		{"noon", -1, false},
		{"", -1, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		options = (struct incise_capture_options){0};
		if (cases[i].ns < 0) {
			assert_error(incise_capture_start_at(&options, cases[i].text,
							     &err),
				     EINVAL, &err, "--start-at", cases[i].text);
			assert_false(options.at_time);
			continue;
		}
		succeeds(!incise_capture_start_at(&options, cases[i].text, &err));
		assert_true(options.at_time);
		assert_int_equal(options.start_ns, cases[i].ns);
		assert_int_equal(options.start_tai, cases[i].tai);
	}
}

/* An input, which is no pulse, and pulses 7 to 9 of which the last comes soon after another. */
TEST(a_pulse_triggers, ON_RIG)
{
	const struct incise_stepper_event events[] = {
		{.t_ns = 1, .type = INCISE_STEPPER_EVENT_SYNC - 1},
		{.t_ns = 2 * S, .type = INCISE_STEPPER_EVENT_SYNC, .position = 7},
		{.t_ns = 3 * S, .type = INCISE_STEPPER_EVENT_SYNC, .position = 8},
		{.t_ns = 3 * S + 1, .type = INCISE_STEPPER_EVENT_SYNC, .position = 9},
	};
	int fd;

	assert_int_equal(mkfifo("events", 0600), 0);
	fd = open("events", O_RDWR | O_CLOEXEC);
	assert_int_equal(write(fd, events, sizeof(events)), sizeof(events));
	options.sync = "events";
	options.duration_s = 1;
	succeeds(!run());
	close(fd);
	assert_true(fabs(result.seconds - 1.02) < 1e-9);
	assert_true(ask("a.rec/recording.db",
			"SELECT group_concat(text) = 'pulse 7,pulse 8' FROM events WHERE "
			"kind = 'sync'"));
}

TEST(what_sends_no_pulses, ON_RIG)
{
	options.sync = "/dev/null";
	assert_error(run(), ENOTTY, &err, "/dev/null", "not a controller");
	options.sync = "none";
	assert_error(run(), ENOENT, &err, "none: ", "incise info stepper");
	assert_int_equal(access("a.rec", F_OK), -1);
}

/* --- verdicts ------------------------------------------------------------------------------ */

/* A recording of 1 s without a fault. */
static void make_result(void)
{
	struct incise_recorder_stats *stats = &result.stats;

	result = (struct incise_capture_result){.seconds = 1};
	stats->force = 10000;
	stats->tracker = stats->depth = stats->poses.poses = 120;
	stats->frames = 50;
	stats->n_streams = 3;
	for (int i = 0; i < 3; i++) {
		snprintf(stats->streams[i].name, sizeof(stats->streams[i].name), "%s",
			 (const char *[]){"force", "tracker", "camera"}[i]);
		stats->streams[i].rows = 50;
	}
}

static int judge(void)
{
	*warnings = 0;
	return incise_capture_judge("b.rec", &options, &result, &err);
}

TEST(verdicts_on_losses_and_devices)
{
	struct incise_recorder_stats *stats = &result.stats;

	options = (struct incise_capture_options){.warn = keep_warning};
	make_result();
	assert_int_equal(judge(), 0);
	assert_string_equal(warnings, "");

	stats->frames_lost = 1;
	assert_error(judge(), ENODATA, &err, "b.rec: 1 frame was lost",
		     "incise verify b.rec");
	stats->force_lost = 3;
	assert_error(judge(), ENODATA, &err, "b.rec: 3 force samples, 1 frame were lost");

	make_result();
	stats->frames = 0;
	assert_error(judge(), ENODATA, &err, "b.rec: ", "no frames", "1.0 s");
	stats->streams[1].rows = 0;
	assert_error(judge(), ENODATA, &err, "b.rec: ", "no samples", "tracker", "1.0 s");
	strcpy(stats->streams[0].ended, "gone");
	assert_error(judge(), ENODEV, &err, "b.rec: ", "the force failed", "gone");
	incise_error_set(&result.early, ENOSPC, "a full disk");
	assert_error(judge(), ENOSPC, &err, "a full disk");
	assert_string_equal(warnings, "");
}

TEST(verdicts_on_poses)
{
	struct incise_recorder_stats *stats = &result.stats;

	options = (struct incise_capture_options){.warn = keep_warning};
	make_result();
	stats->depth = 0;
	assert_int_equal(judge(), 0);
	assert_says(warnings, "b.rec: ", "no depth", "120 poses", "surface");
	stats->poses.flagged['x'] = 1; /* of 120: less than 1 % */
	assert_int_equal(judge(), 0);
	assert_says(warnings, "no depth");
	stats->poses.flagged['x'] = stats->poses.unusable = 2;
	assert_int_equal(judge(), 0);
	assert_says(warnings, "b.rec: ", "'x'");
	stats->poses.flagged['x'] = stats->poses.unusable = 120;
	assert_error(judge(), ENODATA, &err, "b.rec: ", "every pose", "rig.conf");
	/* Nobody needs to hear the warnings. */
	options.warn = NULL;
	assert_error(judge(), ENODATA, &err, "every pose");
}

TEST(verdicts_on_the_wall_time)
{
	struct incise_wall_point points[] = {
		{.t_ns = 0, .tai_ns = 1800000000LL * S, .source = "ptp-master"},
		{.t_ns = S, .tai_ns = 1800000001LL * S, .source = "ptp", .held = true},
		{.t_ns = 2 * S, .tai_ns = 1800000002LL * S, .source = "kernel"},
	};
	static const struct {
		const char *named, *warning;
	} cases[] = {
		{NULL, NULL},
		{"auto", NULL},
		{"ptp:/run/socket", "not by ptp:/run/socket in 2 of 3 points"},
		{"kernel", "not by kernel in 2 of 3 points"},
		{"chrony", "not by chrony in 3 of 3 points"},
	};

	for (int i = 0; i < 3; i++) {
		strcpy(points[i].reference, "TAI");
		strcpy(points[i].leap, "list");
	}
	options = (struct incise_capture_options){.warn = keep_warning};
	make_result();
	result.wall = incise_wall_new(points, 3);
	assert_non_null(result.wall);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		options.recorder.clock_source = cases[i].named;
		assert_int_equal(judge(), 0);
		if (cases[i].warning)
			assert_says(warnings, "b.rec: ", cases[i].warning);
		else
			assert_string_equal(warnings, "");
	}
	incise_wall_free(result.wall);
	result.wall = NULL;
}
