// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/recorder_camera.c: a camera beside the others, one that dies, and one
 * whose file is taken away.
 */
#include "recorded.h"
#include <incise/backend.h>
#include <incise/verify.h>

#define DB "a.rec/recording.db"

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

static struct incise_rig *open_camera(void)
{
	struct incise_error err = {0};
	struct incise_rig *rig;
	struct incise_camera *camera;

	if (!has_frames()) {
		print_message(
			"frames_mkv.so was not built: libavformat-dev is missing\n");
		skip();
	}
	rig = incise_rig_open("sim:clock=simulated", BOTH | INCISE_RIG_CAMERA, &err);

	if (!rig)
		fail_msg("%s", err.text);
	camera = incise_rig_camera(rig);
	real = camera->ops;
	ops = *real;
	ops.read = faulty;
	ops.cause = why;
	camera->ops = &ops;
	dies_at = skips_at = silent_from = silent_to = UINT64_MAX;
	return rig;
}

static struct incise_recorder *start(struct incise_rig *rig, bool armed)
{
	struct incise_calibration calibration;
	struct incise_error err = {0};
	struct incise_recorder *recorder;

	incise_calibration_nominal(&calibration);
	recorder =
		incise_recorder_new("a.rec", rig,
				    &(struct incise_recorder_setup){
					    .calibration = &calibration, .armed = armed},
				    &err);
	if (!recorder)
		fail_msg("%s", err.text);
	return recorder;
}

/* Ends it; the streams as they were at the end. */
static void end(struct incise_recorder *recorder, struct incise_rig *rig,
		struct incise_stream streams[INCISE_STREAMS_MAX])
{
	struct incise_error err = {0};

	if (incise_recorder_end(recorder, &err))
		fail_msg("%s", err.text);
	assert_int_equal(incise_recorder_streams(recorder, streams), 3);
	assert_string_equal(streams[2].name, "camera");
	if (incise_recorder_close(recorder, &err))
		fail_msg("%s", err.text);
	incise_rig_close(rig);
}

static void verified(bool complete)
{
	struct incise_verify_report report;
	struct incise_error err = {0};

	if (incise_verify("a.rec", NULL, &report, &err))
		fail_msg("%s", err.text);
	assert_int_equal(report.complete, complete);
	assert_true(report.intact);
}

static void pictures_are_rows(void **state)
{
	struct incise_rig *rig = open_camera();
	struct incise_recorder *recorder = start(rig, false);
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 1000 * MS, NULL), 0);
	end(recorder, rig, streams);
	/* 50 Hz for a second, from its first picture at 0 */
	assert_in_range(streams[2].rows, 50, 51);
	assert_int_equal(streams[2].lost, 0);
	assert_int_equal(ask(DB, "SELECT count(*) FROM frames"), streams[2].rows);
	assert_int_equal(ask(DB, "SELECT max(seq) - min(seq) + 1 FROM frames"),
			 streams[2].rows);
	assert_int_equal(ask(DB, "SELECT max(t_ns) - min(t_ns) FROM frames"),
			 (streams[2].rows - 1) * 20 * MS);
	verified(true);
}

/* The others go on; all pictures from before are there. */
static void camera_that_dies(void **state)
{
	struct incise_rig *rig = open_camera();
	struct incise_recorder *recorder = start(rig, false);
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

/* Its numbers tell nothing of it: it shot nothing. 50 Hz, and silence is 2 s of it. */
static void silent_camera(void **state)
{
	static const struct {
		uint64_t from, to;
		int events;
		bool ended;
	} cases[] = {
		{50, 140, 0, false},	     {50, 160, 2, false},
		{50, UINT64_MAX, 1, true},   {0, UINT64_MAX, 1, true},
		{200, UINT64_MAX, 0, false}, /* 1 s before the end */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_rig *rig = open_camera();
		struct incise_recorder *recorder = start(rig, false);
		struct incise_stream streams[INCISE_STREAMS_MAX];

		silent_from = cases[i].from;
		silent_to = cases[i].to;
		assert_int_equal(poll_for(recorder, rig, 5000 * MS, NULL), 0);
		end(recorder, rig, streams);
		assert_int_equal(ask(DB,
				     "SELECT count(*) FROM events WHERE kind = 'silent'"),
				 cases[i].events);
		assert_int_equal(*streams[2].ended != 0, cases[i].ended);
		verified(!cases[i].ended && cases[i].to == UINT64_MAX);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

static void lost_picture_is_counted(void **state)
{
	struct incise_rig *rig = open_camera();
	struct incise_recorder *recorder = start(rig, false);
	struct incise_stream streams[INCISE_STREAMS_MAX];

	skips_at = 10;
	assert_int_equal(poll_for(recorder, rig, 600 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_int_equal(streams[2].lost, 1);
	assert_int_equal(ask(DB, "SELECT value FROM meta WHERE key = 'frames_lost'"), 1);
	verified(false);
}

static void armed_camera_begins_with_the_trigger(void **state)
{
	struct incise_rig *rig = open_camera();
	struct incise_recorder *recorder = start(rig, true);
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 1000 * MS, NULL), 0);
	incise_recorder_trigger(recorder);
	assert_int_equal(poll_for(recorder, rig, 500 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_in_range(streams[2].rows, 25, 26);
	assert_int_equal(streams[2].lost, 0);
	verified(true);
}

static void never_triggered_is_empty_and_whole(void **state)
{
	struct incise_rig *rig = open_camera();
	struct incise_recorder *recorder = start(rig, true);
	struct incise_stream streams[INCISE_STREAMS_MAX];

	assert_int_equal(poll_for(recorder, rig, 700 * MS, NULL), 0);
	end(recorder, rig, streams);
	assert_int_equal(streams[2].rows, 0);
	verified(true);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, enter_with_modules, leave_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(pictures_are_rows),
		TEST(camera_that_dies),
		TEST(silent_camera),
		TEST(lost_picture_is_counted),
		TEST(armed_camera_begins_with_the_trigger),
		TEST(never_triggered_is_empty_and_whole),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
