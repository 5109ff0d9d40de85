// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/camera.c: every call reaches the backend with its arguments, and what the
 * backend says comes back.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdio.h>
#include <incise/backend.h>

/* A backend that remembers what it was called with. */
struct fake {
	struct incise_camera camera;
	struct incise_camera_frame *frame;
};

static int fake_read(struct incise_camera *camera, struct incise_camera_frame *frame)
{
	((struct fake *)camera)->frame = frame;
	return -ENODEV;
}

static void fake_info(const struct incise_camera *camera, struct incise_camera_info *info)
{
	info->width = ((const struct fake *)camera)->frame->width;
}

static uint64_t fake_lost(const struct incise_camera *camera)
{
	return ((const struct fake *)camera)->frame->seq;
}

static int fake_cause(struct incise_camera *camera, char *text, size_t size)
{
	return snprintf(text, size, "picture %d", ((struct fake *)camera)->frame->width);
}

static void calls_reach_the_backend(void **state)
{
	static const struct incise_camera_ops ops = {.read = fake_read,
						     .info = fake_info,
						     .lost = fake_lost,
						     .cause = fake_cause};
	struct fake fake = {.camera.ops = &ops};
	struct incise_camera_frame frame = {.width = 77, .seq = 30000000000ULL};
	struct incise_camera_info info = {0};
	char text[20] = "x";

	assert_int_equal(incise_camera_read(&fake.camera, &frame), -ENODEV);
	assert_ptr_equal(fake.frame, &frame);
	incise_camera_info(&fake.camera, &info);
	assert_int_equal(info.width, 77);
	assert_true(incise_camera_lost(&fake.camera) == 30000000000ULL);
	assert_int_equal(incise_camera_cause(&fake.camera, text, sizeof(text)), 10);
	assert_string_equal(text, "picture 77");
}

static void a_backend_that_tells_no_cause_has_an_empty_one(void **state)
{
	static const struct incise_camera_ops ops = {0};
	struct fake fake = {.camera.ops = &ops};
	char text[20] = "x";

	assert_int_equal(incise_camera_cause(&fake.camera, text, sizeof(text)), 0);
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

static void the_newest_is_the_last_that_waits(void **state)
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
		/* Who is slower than the camera comes to an end. */
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
		cmocka_unit_test(a_backend_that_tells_no_cause_has_an_empty_one),
		cmocka_unit_test(the_newest_is_the_last_that_waits),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
