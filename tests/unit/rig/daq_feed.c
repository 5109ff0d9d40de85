// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/daq_feed.c: what is read, clipped, lost and reported at the end; what is asked
 * for and cannot be; the thread.
 */
#include "../unit.h"
#include "../../../lib/rig/daq_feed.h"

static struct daq_feed *feed;

static int setup(void **state)
{
	feed = aligned_alloc(_Alignof(struct daq_feed), sizeof(*feed));
	memset(feed, 0, sizeof(*feed));
	feed->info.bits = 12;
	feed->info.rate_hz = 1;
	return daq_feed_init(feed);
}

static int teardown(void **state)
{
	daq_feed_free(feed);
	free(feed);
	return 0;
}

static uint64_t overflows(void)
{
	struct incise_force_info info;

	daq_feed_info(&feed->force, &info);
	return info.overflows;
}

TEST(both_ends_are_clipped, setup, teardown)
{
	static const struct {
		int32_t code;
		uint64_t clipped;
	} cases[] = {{1, 0}, {0, 1}, {4094, 1}, {4095, 2}, {2048, 2}, {0, 3}};
	struct incise_force_info info;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		daq_feed_put(feed, 0, cases[i].code);
		daq_feed_info(&feed->force, &info);
		assert_int_equal(info.clipped, cases[i].clipped);
	}
	/* the widest there is */
	feed->info.bits = 31;
	daq_feed_put(feed, 0, INT32_MAX);
	daq_feed_put(feed, 0, INT32_MAX - 1);
	daq_feed_info(&feed->force, &info);
	assert_int_equal(info.clipped, 4);
}

TEST(losses_are_gaps, setup, teardown)
{
	struct incise_force_sample samples[4];

	daq_feed_put(feed, 10, 1);
	daq_feed_lose(feed, 0);
	daq_feed_put(feed, 20, 2);
	daq_feed_lose(feed, 7);
	daq_feed_put(feed, 30, 3);
	assert_int_equal(daq_feed_read(&feed->force, samples, 4), 3);
	assert_int_equal(samples[1].seq, 1);
	assert_int_equal(samples[2].seq, 9);
	assert_int_equal(samples[2].t_ns, 30);
	assert_int_equal(daq_feed_lost(&feed->force), 7);
	assert_int_equal(overflows(), 1);
}

/* Nobody reads: what is new is dropped, and each time counted once. */
TEST(no_room, setup, teardown)
{
	struct incise_force_sample samples[1024];

	for (int i = 0; i < 1030; i++)
		daq_feed_put(feed, i, 5);
	assert_int_equal(daq_feed_lost(&feed->force), 6);
	assert_int_equal(overflows(), 1);
	assert_int_equal(daq_feed_read(&feed->force, samples, 1024), 1024);
	assert_int_equal(samples[1023].seq, 1023);
	daq_feed_put(feed, 0, 5);
	assert_int_equal(daq_feed_read(&feed->force, samples, 1024), 1);
	assert_int_equal(samples[0].seq, 1030);
	for (int i = 0; i < 1025; i++)
		daq_feed_put(feed, i, 5);
	assert_int_equal(daq_feed_lost(&feed->force), 7);
	assert_int_equal(overflows(), 2);
}

TEST(the_end_is_told_last, setup, teardown)
{
	struct incise_force_sample sample;
	char cause[200] = "?";

	assert_int_equal(daq_feed_read(&feed->force, &sample, 1), 0);
	assert_int_equal(daq_feed_cause(&feed->force, cause, sizeof(cause)), 0);
	assert_string_equal(cause, "");
	daq_feed_put(feed, 0, 5);
	daq_feed_end(feed, -ENODEV, "not this");
	assert_int_equal(daq_feed_read(&feed->force, &sample, 1), 1);
	assert_int_equal(daq_feed_read(&feed->force, &sample, 1), -ENODEV);
	assert_int_equal(daq_feed_read(&feed->force, &sample, 1), -ENODEV);
	assert_true(daq_feed_cause(&feed->force, cause, sizeof(cause)) > 0);
	assert_non_null(strstr(cause, "was unplugged; plug it in"));
	daq_feed_end(feed, -EIO, "its clock stands still; see to it");
	daq_feed_cause(&feed->force, cause, sizeof(cause));
	assert_non_null(strstr(cause, ": its clock stands still; see to it"));
}

TEST(what_is_asked_for, setup, teardown)
{
	static const struct {
		struct incise_force_setup setup;
		int rc;
	} cases[] = {
		{{.rate_hz = 1}, 0},
		{{.rate_hz = 100000}, 0},
		{{.rate_hz = 0.5}, -EINVAL},
		{{.rate_hz = 100001}, -EINVAL},
		{{.rate_hz = 0.0 / 0.0}, -EINVAL},
		{{.rate_hz = 1000, .channel = -1}, -EINVAL},
	};
	struct incise_backend_request request = {.where = "r.conf:1: force"};
	struct incise_force_setup setup;

	assert_int_equal(daq_feed_setup(&request, &setup, &err), 0);
	assert_true(setup.rate_hz == 10000);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		request.force = &cases[i].setup;
		assert_int_equal(daq_feed_setup(&request, &setup, &err), cases[i].rc);
	}
	assert_says(err.text, "r.conf:1: force:", "channel -1");
}

static void *run(void *card)
{
	while (daq_feed_wait(feed, -1, 10000) != DAQ_STOP)
		*(int *)card += 1;
	return NULL;
}

/* A thread that waits is ended at once, and only once. */
TEST(the_thread_ends, setup, teardown)
{
	int count = 0;

	assert_int_equal(daq_feed_start(feed, run, &count), 0);
	daq_feed_stop(feed);
	assert_int_equal(count, 0);
	daq_feed_stop(feed);
}
