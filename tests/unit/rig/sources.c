// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/sources.c: every call reaches the backend with its arguments and returns what the
 * backend returns.
 */
#include "../unit.h"
#include <incise/backend.h>

/* --- tracker --- */

/* A backend that remembers what it was called with. */
struct tracker_fake {
	struct incise_tracker tracker;
	struct incise_tracker_sample *samples;
	int n;
};

static int tracker_fake_read(struct incise_tracker *tracker,
			     struct incise_tracker_sample *samples, int n)
{
	struct tracker_fake *tracker_fake = (struct tracker_fake *)tracker;

	tracker_fake->samples = samples;
	tracker_fake->n = n;
	return -EIO;
}

static void tracker_fake_info(const struct incise_tracker *tracker,
			      struct incise_tracker_info *info)
{
	info->rate_hz = ((const struct tracker_fake *)tracker)->n;
}

static uint64_t tracker_fake_lost(const struct incise_tracker *tracker)
{
	return ((const struct tracker_fake *)tracker)->n * 10000000000ULL;
}

TEST(tracker_calls_reach_the_backend)
{
	static const struct incise_tracker_ops ops = {.read = tracker_fake_read,
						      .info = tracker_fake_info,
						      .lost = tracker_fake_lost};
	struct tracker_fake tracker_fake = {.tracker.ops = &ops};
	struct incise_tracker_sample samples[3];
	struct incise_tracker_info info = {0};

	assert_int_equal(incise_tracker_read(&tracker_fake.tracker, samples, 3), -EIO);
	assert_ptr_equal(tracker_fake.samples, samples);
	assert_int_equal(tracker_fake.n, 3);
	incise_tracker_info(&tracker_fake.tracker, &info);
	assert_true(info.rate_hz == 3);
	assert_true(incise_tracker_lost(&tracker_fake.tracker) == 30000000000ULL);
}

/* --- force --- */

/* A backend that remembers what it was called with. */
struct force_fake {
	struct incise_force force;
	struct incise_force_sample *samples;
	int n;
};

static int force_fake_read(struct incise_force *force,
			   struct incise_force_sample *samples, int n)
{
	struct force_fake *force_fake = (struct force_fake *)force;

	force_fake->samples = samples;
	force_fake->n = n;
	return -EIO;
}

static void force_fake_info(const struct incise_force *force,
			    struct incise_force_info *info)
{
	info->rate_hz = ((const struct force_fake *)force)->n;
}

static uint64_t force_fake_lost(const struct incise_force *force)
{
	return ((const struct force_fake *)force)->n * 10000000000ULL;
}

TEST(force_calls_reach_the_backend)
{
	static const struct incise_force_ops ops = {.read = force_fake_read,
						    .info = force_fake_info,
						    .lost = force_fake_lost};
	struct force_fake force_fake = {.force.ops = &ops};
	struct incise_force_sample samples[3];
	struct incise_force_info info = {0};

	assert_int_equal(incise_force_read(&force_fake.force, samples, 3), -EIO);
	assert_ptr_equal(force_fake.samples, samples);
	assert_int_equal(force_fake.n, 3);
	incise_force_info(&force_fake.force, &info);
	assert_true(info.rate_hz == 3);
	assert_true(incise_force_lost(&force_fake.force) == 30000000000ULL);
}

/* The part of a calibration that applies to a channel in volts, and to one in newtons. */
TEST(a_channel_in_newtons_has_no_sensitivity)
{
	static const struct {
		bool newtons;
		double mV_N, zero_mV, to_mV_N, to_zero_mV;
	} row[] = {
		{false, 1240, 180, 1240, 180}, {false, 1000, NAN, 1000, NAN},
		{true, 1240, 180, 1000, NAN},  {true, 1000, -20, 1000, -20},
		{true, 1000, NAN, 1000, NAN},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		struct incise_force_info info = {.newtons = row[i].newtons};
		struct incise_calibration c = {.force_mV_N = row[i].mV_N,
					       .force_zero_mV = row[i].zero_mV,
					       .depth_mm_px = 7};

		incise_force_calibration(&info, &c);
		assert_true(c.force_mV_N == row[i].to_mV_N && c.depth_mm_px == 7);
		assert_true(c.force_zero_mV == row[i].to_zero_mV ||
			    (isnan(c.force_zero_mV) && isnan(row[i].to_zero_mV)));
	}
}

/* --- camera --- */

/* A backend that remembers what it was called with. */
struct camera_fake {
	struct incise_camera camera;
	struct incise_camera_frame *frame;
};

static int camera_fake_read(struct incise_camera *camera,
			    struct incise_camera_frame *frame)
{
	((struct camera_fake *)camera)->frame = frame;
	return -ENODEV;
}

static void camera_fake_info(const struct incise_camera *camera,
			     struct incise_camera_info *info)
{
	info->width = ((const struct camera_fake *)camera)->frame->width;
}

static uint64_t camera_fake_lost(const struct incise_camera *camera)
{
	return ((const struct camera_fake *)camera)->frame->seq;
}

static int fake_cause(struct incise_camera *camera, char *text, size_t size)
{
	return snprintf(text, size, "picture %d",
			((struct camera_fake *)camera)->frame->width);
}

TEST(camera_calls_reach_the_backend)
{
	static const struct incise_camera_ops ops = {.read = camera_fake_read,
						     .info = camera_fake_info,
						     .lost = camera_fake_lost,
						     .cause = fake_cause};
	struct camera_fake camera_fake = {.camera.ops = &ops};
	struct incise_camera_frame frame = {.width = 77, .seq = 30000000000ULL};
	struct incise_camera_info info = {0};
	char text[20] = "x";

	assert_int_equal(incise_camera_read(&camera_fake.camera, &frame), -ENODEV);
	assert_ptr_equal(camera_fake.frame, &frame);
	incise_camera_info(&camera_fake.camera, &info);
	assert_int_equal(info.width, 77);
	assert_true(incise_camera_lost(&camera_fake.camera) == 30000000000ULL);
	assert_int_equal(incise_camera_cause(&camera_fake.camera, text, sizeof(text)),
			 10);
	assert_string_equal(text, "picture 77");
}

TEST(a_backend_that_tells_no_cause_has_an_empty_one)
{
	static const struct incise_camera_ops ops = {0};
	struct camera_fake camera_fake = {.camera.ops = &ops};
	char text[20] = "x";

	assert_int_equal(incise_camera_cause(&camera_fake.camera, text, sizeof(text)), 0);
	assert_string_equal(text, "");
}

/* A backend in which pictures wait, and behind them an end. */
struct queue {
	struct incise_camera camera;
	uint64_t next, waiting;
	int end;
};

static int queue_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	struct queue *q = (struct queue *)camera;

	if (q->next == q->waiting)
		return q->end;
	frame->seq = q->next++;
	return 1;
}

TEST(the_newest_is_the_last_that_waits)
{
	static const struct incise_camera_ops ops = {.read = queue_read};
	static const struct {
		uint64_t waiting;
		int end, first, second;
		uint64_t seq; /* 77: as it was */
	} cases[] = {
		{0, 0, 0, 0, 77},
		{1, 0, 1, 0, 0},
		{24, 0, 1, 0, 23},
		/* The end comes behind the last picture, as of one read by one. */
		{0, -EIO, -EIO, -EIO, 77},
		{3, -ENODEV, 1, -ENODEV, 2},
		/* A reader slower than the camera comes to an end. */
		{UINT64_MAX, 0, 1, 1, 63},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct queue q = {{&ops}, 0, cases[i].waiting, cases[i].end};
		struct incise_camera_frame frame = {.seq = 77};

		assert_int_equal(incise_camera_newest(&q.camera, &frame), cases[i].first);
		assert_int_equal(incise_camera_newest(&q.camera, &frame),
				 cases[i].second);
		assert_true(frame.seq == cases[i].seq);
	}
}
