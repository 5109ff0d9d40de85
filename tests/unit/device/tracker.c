// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/tracker.c: every call reaches the backend with its arguments, and what the
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
	struct incise_tracker tracker;
	struct incise_tracker_sample *samples;
	int n;
};

static int fake_read(struct incise_tracker *tracker,
		     struct incise_tracker_sample *samples, int n)
{
	struct fake *fake = (struct fake *)tracker;

	fake->samples = samples;
	fake->n = n;
	return -EIO;
}

static void fake_info(const struct incise_tracker *tracker,
		      struct incise_tracker_info *info)
{
	info->rate_hz = ((const struct fake *)tracker)->n;
}

static uint64_t fake_lost(const struct incise_tracker *tracker)
{
	return ((const struct fake *)tracker)->n * 10000000000ULL;
}

static void calls_reach_the_backend(void **state)
{
	static const struct incise_tracker_ops ops = {
		.read = fake_read, .info = fake_info, .lost = fake_lost};
	struct fake fake = {.tracker.ops = &ops};
	struct incise_tracker_sample samples[3];
	struct incise_tracker_info info = {0};

	assert_int_equal(incise_tracker_read(&fake.tracker, samples, 3), -EIO);
	assert_ptr_equal(fake.samples, samples);
	assert_int_equal(fake.n, 3);
	incise_tracker_info(&fake.tracker, &info);
	assert_true(info.rate_hz == 3);
	assert_true(incise_tracker_lost(&fake.tracker) == 30000000000ULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(calls_reach_the_backend),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
