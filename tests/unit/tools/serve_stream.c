// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of tools/serve/stream.c: rates, means and times of what reaches a sink. */
#include "../unit.h"
#include <time.h>
#include "../../../tools/cli/cli.h"
#include "../../../tools/serve/stream.h"

#define NS 1000000000LL
#define MOST 4000

struct kept {
	struct serve_sink base;
	struct serve_item item[MOST];
	char name[32];
	int n;
};

static void keep(struct serve_sink *sink, const struct serve_item *item)
{
	struct kept *kept = (struct kept *)sink;

	assert_in_range(kept->n, 0, MOST - 1);
	kept->item[kept->n++] = *item;
	if (item->kind == SERVE_STATUS)
		snprintf(kept->name, sizeof(kept->name), "%s", item->status.name);
}

/* UTC of a source is a second later than its time here. */
static int64_t utc(struct serve_source *source, int64_t t_ns)
{
	return t_ns + NS;
}

static const struct serve_sink_ops sink_ops = {.send = keep};
static const struct serve_source_ops source_ops = {.utc = utc};
static struct serve_source source = {&source_ops};
static struct kept kept;

static struct serve_stream *start(double rate_hz)
{
	struct serve_stream *stream = serve_stream_new(&source, rate_hz);

	memset(&kept, 0, sizeof(kept));
	kept.base.ops = &sink_ops;
	serve_stream_add(stream, &kept.base);
	return stream;
}

static const double here[3] = {1, 2, 3}, turned[4] = {M_SQRT1_2, 0, 0, M_SQRT1_2},
		    none[3];

TEST(a_source_of_the_very_rate_keeps_all)
{
	struct serve_stream *stream = start(1000);

	/* by up to 0.4 of a period early or late, which is less than the half */
	for (int i = 0; i < 1000; i++)
		serve_pose(stream, 5 * NS + i * 1000000LL + (i * 7919 % 801 - 400) * 1000,
			   here, turned, none, 0);
	assert_int_equal(kept.n, 1000);
	assert_int_equal(serve_stream_sent(stream, SERVE_POSE), 1000);
	assert_true(kept.item[7].utc_ns == kept.item[7].t_ns + NS);
	assert_true(kept.item[7].here_ns == kept.item[7].t_ns);
	serve_stream_free(stream);
}

TEST(a_faster_one_is_thinned_and_a_gap_starts_again)
{
	struct serve_stream *stream = start(100);

	for (int i = 0; i < 1000; i++)
		serve_pose(stream, 5 * NS + i * 1000000LL, here, turned, none, 3);
	assert_in_range(kept.n, 99, 101);
	for (int i = 1; i < kept.n; i++)
		assert_in_range(kept.item[i].t_ns - kept.item[i - 1].t_ns, 9000000,
				11000000);
	kept.n = 0;
	/* no burst after a pause */
	for (int i = 0; i < 100; i++)
		serve_pose(stream, 60 * NS + i * 1000000LL, here, turned, none, 3);
	assert_in_range(kept.n, 10, 11);
	assert_int_equal(kept.item[0].lost, 3);
	assert_int_equal(serve_stream_lost(stream), 3);
	serve_stream_free(stream);
}

TEST(forces_are_means_with_their_deviation)
{
	struct serve_stream *stream = start(100);
	double sum = 0, squares = 0;

	/* A large offset would eat the digits of a sum of squares. */
	for (int i = 0; i < 1000; i++) {
		double force_N[3] = {0, 0, 1e6 + i * 37 % 101};

		serve_force(stream, 5 * NS + i * 100000LL, force_N, 0);
	}
	/* The first one is due at once; from then on 100 samples each. */
	assert_int_equal(kept.n, 10);
	assert_int_equal(kept.item[0].force.samples, 1);
	assert_true(isnan(kept.item[0].force.sd_N));
	for (int k = 2; k < 10; k++) {
		const struct serve_item *item = &kept.item[k];
		int n = item->force.samples, last = 0;

		assert_int_equal(n, 100);
		/* the samples before the one at this time, and that one */
		last = (int)((item->t_ns - 5 * NS) / 100000) + n / 2;
		assert_int_equal(last, 100 * k);
		sum = squares = 0;
		for (int i = last - n + 1; i <= last; i++)
			sum += i * 37 % 101;
		for (int i = last - n + 1; i <= last; i++)
			squares += (i * 37 % 101 - sum / n) * (i * 37 % 101 - sum / n);
		/* 1e6 has 52 - 20 bits behind the point */
		assert_true(fabs(item->force.mean_N[2] - 1e6 - sum / n) < 1e-8);
		assert_true(fabs(item->force.sd_N - sqrt(squares / (n - 1))) < 1e-8);
		assert_true(item->force.mean_N[0] == 0);
	}
	serve_stream_free(stream);
}

TEST(the_tip_turns_with_the_scalpel)
{
	static const double tip[3] = {10, 0, 5};
	struct serve_stream *stream = start(100);
	double q[4];

	/* a quarter of a turn about z: x becomes y */
	serve_pose(stream, 5 * NS, here, turned, tip, 0);
	assert_true(fabs(kept.item[0].pose.position_mm[0] - 1) < 1e-12);
	assert_true(fabs(kept.item[0].pose.position_mm[1] - 12) < 1e-12);
	assert_true(fabs(kept.item[0].pose.position_mm[2] - 8) < 1e-12);
	/* it is made a unit; a fault's has length 0 and is not sent */
	for (int i = 0; i < 4; i++)
		q[i] = turned[i] * 1.01;
	serve_pose(stream, 6 * NS, here, q, none, 0);
	assert_true(fabs(kept.item[1].pose.quaternion[0] - M_SQRT1_2) < 1e-12);
	serve_pose(stream, 7 * NS, here, (const double[4]){0}, none, 0);
	serve_pose(stream, 8 * NS, here, (const double[4]){NAN, 0, 0, 0}, none, 0);
	assert_int_equal(kept.n, 2);
	serve_stream_free(stream);
}

TEST(a_state_is_sent_when_it_changes)
{
	struct serve_stream *stream = start(100);

	for (int i = 0; i < 100; i++)
		serve_status(stream, SERVE_RUNS, "running", "loop a");
	/* the second of a heartbeat cannot have passed a hundred times */
	assert_in_range(kept.n, 1, 99);
	kept.n = 0;
	serve_status(stream, SERVE_FAULT, "fault", "loop a: limit switch");
	assert_int_equal(kept.n, 1);
	assert_string_equal(kept.name, "fault");
	serve_stream_free(stream);
}

TEST(a_recording_is_played_at_its_speed)
{
	struct serve_stream *stream = start(100);

	serve_play(stream, 5 * NS, 700 * NS, 4);
	for (int i = 0; i < 4000; i++)
		serve_pose(stream, 5 * NS + i * 1000000LL, here, turned, none, 0);
	/* 4 s in one second: 100 of them */
	assert_in_range(kept.n, 99, 101);
	assert_true(kept.item[50].here_ns ==
		    700 * NS + (kept.item[50].t_ns - 5 * NS) / 4);
	assert_true(kept.item[50].utc_ns == kept.item[50].t_ns + NS);
	serve_stream_free(stream);
}

TEST(utc_is_that_of_the_clock)
{
	struct timespec before, after;
	int64_t start_ns, took_ns, ours;

	/* again, if the machine stood still or its clock was set meanwhile */
	do {
		start_ns = cli_now_ns();
		clock_gettime(CLOCK_REALTIME, &before);
		ours = serve_utc_of(cli_now_ns());
		clock_gettime(CLOCK_REALTIME, &after);
		took_ns = (after.tv_sec - before.tv_sec) * NS + after.tv_nsec -
			  before.tv_nsec;
	} while (cli_now_ns() - start_ns > NS || took_ns < 0 || took_ns > NS);
	assert_in_range(ours, before.tv_sec * NS + before.tv_nsec - NS,
			after.tv_sec * NS + after.tv_nsec + NS);
}
