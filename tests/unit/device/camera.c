// SPDX-License-Identifier: LGPL-2.1-or-later
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

static void calls_reach_the_backend(void **state)
{
	static const struct incise_camera_ops ops = {
		.read = fake_read, .info = fake_info, .lost = fake_lost};
	struct fake fake = {.camera.ops = &ops};
	struct incise_camera_frame frame = {.width = 77, .seq = 30000000000ULL};
	struct incise_camera_info info = {0};

	assert_int_equal(incise_camera_read(&fake.camera, &frame), -ENODEV);
	assert_ptr_equal(fake.frame, &frame);
	incise_camera_info(&fake.camera, &info);
	assert_int_equal(info.width, 77);
	assert_true(incise_camera_lost(&fake.camera) == 30000000000ULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
