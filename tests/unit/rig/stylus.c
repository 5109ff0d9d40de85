// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/stylus.c: poses in the scene's frame, a clutch that moves nothing, no force before the start and
 * without the enabling button, and the ages of poses; with a device whose samples are given here.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/rig/stylus.h"
#include "../cases.h"

#define MS 1000000LL

struct stub {
	struct incise_haptic haptic;
	struct incise_haptic_sample sample;
	int n;
	double force_N[3];
};

static int read_stub(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		     int n)
{
	struct stub *stub = (struct stub *)haptic;
	int got = stub->n < n ? stub->n : n;

	for (int i = 0; i < got; i++)
		samples[i] = stub->sample;
	stub->n = 0;
	return got;
}

static int push_stub(struct incise_haptic *haptic, const double force_N[3],
		     const double torque_N_mm[3])
{
	(void)torque_N_mm;
	v3_copy(((struct stub *)haptic)->force_N, force_N);
	return 0;
}

static uint64_t lost_stub(const struct incise_haptic *haptic)
{
	(void)haptic;
	return 3;
}

static const struct incise_haptic_ops ops = {
	.read = read_stub, .push = push_stub, .lost = lost_stub};

static struct stub stub;
static struct incise_stylus *stylus;
static int64_t now_ns;

static void make_stub(const struct incise_haptic_setup *setup)
{
	free(stylus);
	stub = (struct stub){
		.haptic = {.ops = &ops,
			   .info = {.name = "stub",
				    .low_mm = {-100, -50, 0},
				    .high_mm = {100, 50, 80},
				    .rate_hz = 1000,
				    .latency_ns = MS}},
		.sample = {.quaternion = {1}, .position_mm = {0, 0, 40}},
	};
	stylus = incise_stylus_new(&stub.haptic, setup);
	assert_non_null(stylus);
	now_ns = 1000 * MS;
}

/* The next tick, with a sample of that age. */
static enum incise_haptic_off step(int64_t age_ns, struct incise_tracker_sample *pose)
{
	struct incise_tracker_sample poses[4];
	struct incise_tracker *tracker = &stylus->tracker;

	now_ns += MS;
	stub.sample.t_ns = now_ns - age_ns;
	stub.sample.seq++;
	stub.n = 1;
	assert_int_equal(tracker->ops->read(tracker, poses, 4), 1);
	if (pose)
		*pose = poses[0];
	return incise_stylus_off(stylus, now_ns);
}

static const struct incise_haptic_setup plain = {.turn = {1}, .start_s = 1};

TEST(poses_and_forces_turn_with_the_frame)
{
	/* Signs and order by hand: a quarter about z takes x to y. */
	struct incise_haptic_setup setup = plain;
	struct incise_tracker_sample pose;
	struct incise_tracker_info info;
	struct incise_tracker *tracker;

	setup.turn[0] = setup.turn[3] = sqrt(0.5);
	setup.origin_mm[0] = 7;
	make_stub(&setup);
	stub.sample = (struct incise_haptic_sample){.position_mm = {1, 2, 3},
						    .quaternion = {sqrt(0.5), sqrt(0.5)}};
	step(MS, &pose);
	assert_float_equal(pose.position_mm[0], 7 - 2, 1e-12);
	assert_float_equal(pose.position_mm[1], 1, 1e-12);
	assert_float_equal(pose.position_mm[2], 3, 1e-12);
	for (int i = 0; i < 4; i++)
		assert_float_equal(pose.quaternion[i], 0.5, 1e-12);
	/* The arrival is the acquisition and the latency. */
	assert_int_equal(pose.t_ns, now_ns);
	incise_stylus_push(stylus, (double[]){0, 2, 1});
	assert_float_equal(stub.force_N[0], 2, 1e-12);
	assert_float_equal(stub.force_N[1], 0, 1e-12);
	assert_float_equal(stub.force_N[2], 1, 1e-12);
	tracker = &stylus->tracker;
	tracker->ops->info(tracker, &info);
	assert_string_equal(info.haptic->name, "stub");
	assert_true(info.rate_hz == 1000 && info.latency_ns == MS);
	assert_int_equal(tracker->ops->lost(tracker), 3);
}

TEST(a_force_begins_in_the_middle_only)
{
	make_stub(&plain);
	assert_int_equal(incise_stylus_off(stylus, now_ns), INCISE_HAPTIC_UNREADY);
	stub.sample.position_mm[2] = 70;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_OUTSIDE);
	stub.sample.position_mm[2] = 59;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ON);
	/* Once on, it stays so anywhere. */
	stub.sample.position_mm[2] = 200;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ON);
	stub.sample.flags = INCISE_HAPTIC_PROTECTED;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_UNREADY);
	stub.sample.flags = INCISE_HAPTIC_BATTERY;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_OUTSIDE);
	stub.sample.position_mm[2] = 30;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ON);
}

TEST(without_its_button_there_is_no_force)
{
	struct incise_haptic_setup setup = plain;

	setup.enable = 2;
	make_stub(&setup);
	stub.sample.buttons = 1;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ENABLE);
	stub.sample.buttons = 2;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ON);
	stub.sample.buttons = 0;
	assert_int_equal(step(MS, NULL), INCISE_HAPTIC_ENABLE);
}

/* With the clutch pressed the tool stays, and let go it goes on from there, at any turn. */
TEST(a_clutch_moves_nothing)
{
	uint64_t random = cases_seed(1);
	struct incise_tracker_sample pose, before;
	struct incise_haptic_setup setup = plain;

	setup.clutch = 1;
	setup.turn[0] = 0.8;
	setup.turn[1] = 0.6;
	make_stub(&setup);
	step(MS, &before);
	for (int i = 0; i < 2000; i++) {
		bool was = stub.sample.buttons;
		double way = 0;

		if (incise_random_draw(&random, 20) == 0)
			stub.sample.buttons ^= 1;
		for (int k = 0; k < 3; k++)
			stub.sample.position_mm[k] +=
				incise_random_symmetric(&random) / 2;
		step(MS, &pose);
		for (int k = 0; k < 3; k++)
			way = fmax(way,
				   fabs(pose.position_mm[k] - before.position_mm[k]));
		if (was)
			assert_true(way < 1e-9);
		assert_true(way < 1);
		assert_int_equal(incise_stylus_off(stylus, now_ns) ==
					 INCISE_HAPTIC_CLUTCH,
				 stub.sample.buttons);
		before = pose;
	}
}

TEST(old_poses_take_the_force_away)
{
	struct incise_tracker_sample pose;
	struct incise_haptic_ages ages;
	int ticks = 0;

	make_stub(&plain);
	for (int i = 0; i < 100; i++)
		assert_int_equal(step(MS + i % 2 * MS, NULL), INCISE_HAPTIC_ON);
	incise_stylus_ages(stylus, &ages);
	assert_float_equal(ages.assumed_ms, 2, 1e-9);
	assert_float_equal(ages.mean_ms, 1.5, 1e-9);
	assert_float_equal(ages.jitter_ms, 0.5, 1e-9);
	assert_float_equal(ages.most_ms, 2, 1e-9);
	assert_int_equal(ages.lost, 3);
	/* 20 ms late: a few ticks are enough. */
	while (step(20 * MS, NULL) == INCISE_HAPTIC_ON)
		ticks++;
	assert_int_equal(incise_stylus_off(stylus, now_ns), INCISE_HAPTIC_LATE);
	assert_in_range(ticks, 1, 10);
	/* Where the plan assumes as much there is no lack. */
	incise_stylus_assume(stylus, 20 * MS);
	assert_int_equal(step(20 * MS, &pose), INCISE_HAPTIC_ON);
	/* A predictor that is told of that latency dates the pose right. */
	assert_int_equal(pose.t_ns - 20 * MS, stub.sample.t_ns);
}

TEST(wrong_samples_are_flagged)
{
	static const struct {
		double x_mm, w;
		uint32_t flags;
		char status;
	} row[] = {
		{NAN, 1, 0, '~'}, {INFINITY, 1, 0, '~'}, {2e6, 1, 0, '~'},
		{0, NAN, 0, '~'}, {0, 0, 0, '~'},	 {0, 1, 1, '!'},
		{0, 1, 4, ' '},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		struct incise_tracker_sample pose;

		make_stub(&plain);
		stub.sample.position_mm[0] = row[i].x_mm;
		stub.sample.quaternion[0] = row[i].w;
		stub.sample.flags = row[i].flags;
		step(MS, &pose);
		assert_int_equal(pose.status, row[i].status);
		assert_int_equal(incise_stylus_off(stylus, now_ns) == INCISE_HAPTIC_ON,
				 row[i].status == ' ');
	}
	free(stylus);
	stylus = NULL;
}
