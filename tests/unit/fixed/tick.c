// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The stages of a tick in integers: limits and targets. ../scene/forces.c compares each force with its
 * formula; ../../fuzz/fixed_plan.c has random plans at work, and numbers at their ends.
 */
#include "../unit.h"
#include "trial_plan.h"

#define CASES 20000

static struct incise_fx_trial trial;
static struct incise_fixed_state tick_state;

static double any(double least, double most)
{
	return least +
	       (most - least) * (incise_fx_trial_next(&trial.seed) >> 11) * 0x1p-53;
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int begin(void **state)
{
	memset(&tick_state, 0, sizeof(tick_state));
	if (!trial.seed)
		trial.seed = 1;
	return 0;
}

static double length_of(const int32_t v[3])
{
	return sqrt((double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2]);
}

/* The same as in real numbers, but for rounding: towards 0 in each of three steps. */
TEST(test_limit, begin)
{
	for (int k = 0; k < CASES; k++) {
		struct incise_fixed_plan plan = {
			.numbers = {.force = 1 + (int32_t)any(0, 1 << 20),
				    .slew = 1 + (int32_t)any(0, 1 << 18)}};
		double most = plan.numbers.force, slew = plan.numbers.slew, want[3],
		       change[3], length, step[3];
		struct incise_fixed_tick tick = {0};
		int32_t last[3], moved[3];

		for (int i = 0; i < 3; i++) {
			last[i] = tick_state.last[i] = (int32_t)any(-most / 2, most / 2);
			tick.command[i] = (int32_t)any(-2 * most, 2 * most);
		}
		length = length_of(tick.command);
		for (int i = 0; i < 3; i++)
			change[i] = tick.command[i] * fmin(1, most / length) - last[i];
		length = sqrt(dot(change, change));
		for (int i = 0; i < 3; i++)
			want[i] = last[i] + change[i] * fmin(1, slew / length);
		incise_fixed_stage_limit(&plan, &tick_state, &tick);
		for (int i = 0; i < 3; i++) {
			moved[i] = tick.command[i] - last[i];
			step[i] = tick.command[i] - want[i];
			assert_true(fabs(step[i]) <= 4);
			assert_int_equal(tick_state.last[i], tick.command[i]);
		}
		assert_true(length_of(tick.command) <= most);
		assert_true(length_of(moved) <= slew + 2 * sqrt(3));
	}
}

/* The nut goes where the spring pushes with the force along its axis. */
TEST(test_targets, begin)
{
	struct incise_fixed_plan plan = {
		.numbers = {.n_axes = 1,
			    .pose_age_ns = 1000000000,
			    .tick_ns = 1000000,
			    .average_ticks = 1,
			    .force = 8 << 16,
			    .slew = 8 << 16,
			    .reaction = 1 << 15,
			    .small = INT32_MAX,
			    .side = {INCISE_FIXED_UNIT},
			    .shape = {.normal = {0, 0, INCISE_FIXED_UNIT}},
			    .filter = {.alpha = INCISE_FIXED_UNIT, .period_ns = 1000000},
			    .axes = {{.direction = {0, 0, INCISE_FIXED_UNIT},
				      .dual = {0, 0, 1 << 24},
				      .compliance = 2 << 20,
				      .steps_per_mm = 100 << 16,
				      .origin = -(50 << 16),
				      .travel = 60 << 16,
				      .rest = 10 << 16}}}};
	struct incise_fixed_pose pose = {.quaternion = {INCISE_FIXED_UNIT},
					 .position = {0, 0, -(6 << 16)}};
	struct incise_fixed_tick tick;

	incise_fixed_plan_begin(&plan, &tick_state);
	incise_fixed_plan_tick(&plan, &tick_state, 1000000, &tick);
	/* Without a pose it is at rest. */
	assert_int_equal(tick.target[0], 1000);
	assert_true(tick.flags & INCISE_TICK_STALE);
	for (int k = 2; k < 40; k++) {
		pose.t_ns = (int64_t)k * 1000000;
		assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose,
							pose.t_ns),
				 INCISE_FIXED_POSE_TAKEN);
		incise_fixed_plan_tick(&plan, &tick_state, pose.t_ns, &tick);
	}
	/* 6 mm deep are 3 N, which are 6 mm of the spring: 44 + 6 mm from the origin. */
	assert_int_equal(tick.command[2], 3 << 16);
	assert_int_equal(tick.along[0], 3 << 16);
	assert_int_equal(tick.target[0], 5000);
	assert_false(tick.flags & INCISE_TICK_TRAVEL);
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_OLD);
	pose.t_ns += 1000000;
	pose.position[0] = INT32_MAX;
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_FAR);
	pose.tool = INCISE_FIXED_POSE_TUBE;
	assert_int_equal(incise_fixed_plan_pose(&plan, &tick_state, &pose, pose.t_ns),
			 INCISE_FIXED_POSE_UNKNOWN);
}
