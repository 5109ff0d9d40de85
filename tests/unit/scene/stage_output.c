// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * From the tissue's force to the actuator, stage by stage, on a plan made by hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/backend.h>
#include "../../../lib/scene/stages.h"

/* An actuator that tells what it was asked, and says what it is told. */
struct told {
	struct incise_stepper stepper;
	struct incise_stepper_status status;
	int rc, set_rc, sets;
	const char *cause;
	double target_mm;
};

static int told_set(struct incise_stepper *stepper, double position_mm)
{
	struct told *told = (struct told *)stepper;

	told->sets++;
	told->target_mm = position_mm;
	return told->set_rc;
}

static int told_status(struct incise_stepper *stepper,
		       struct incise_stepper_status *status)
{
	struct told *told = (struct told *)stepper;

	*status = told->status;
	return told->rc;
}

static int told_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	const char *cause = ((struct told *)stepper)->cause;

	return cause ? snprintf(text, size, "%s", cause) : 0;
}

static const struct incise_stepper_ops ops = {
	.set = told_set, .status = told_status, .cause = told_cause};

/* A spring of 2 N/mm and a travel of 20 mm, pushing along z. */
static struct incise_plan plan_on(struct told *told)
{
	*told = (struct told){.stepper = {.ops = &ops}};
	return (struct incise_plan){
		.stepper = &told->stepper,
		.actuator = {.spring_N_mm = 2,
			     .travel_mm = 20,
			     .step_mm = 0.001,
			     .measures_handle = true},
		.axis = {0, 0, 1},
	};
}

static void test_the_nut_goes_where_its_spring_gives_the_force(void **state)
{
	static const struct {
		double handle_mm, force_N[3], target_mm;
		bool travel;
	} cases[] = {
		{5, {0, 0, 0}, 5, false},
		{5, {0, 0, 3}, 6.5, false},
		{5, {0, 0, -3}, 3.5, false},
		/* What is across the axis is not felt. */
		{5, {4, -4, 1}, 5.5, false},
		/* The ends of the travel, and less than a step beyond them. */
		{19, {0, 0, 2}, 20, false},
		{19, {0, 0, 2.0019}, 20, false},
		{19, {0, 0, 2.0021}, 20, true},
		{1, {0, 0, -2.0019}, 0, false},
		{1, {0, 0, -2.0021}, 0, true},
		{0, {0, 0, -100}, 0, true},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct told told;
		struct incise_plan plan = plan_on(&told);
		struct incise_tick tick = {0};

		told.status.handle_mm = cases[i].handle_mm;
		told.status.force_N = 0.25;
		memcpy(plan.limit.last_N, cases[i].force_N, sizeof(plan.limit.last_N));
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		/* Sums and quotients of small decimals: some ulp of 20. */
		if (!(fabs(told.target_mm - cases[i].target_mm) < 1e-14) ||
		    !!(tick.flags & INCISE_TICK_TRAVEL) != cases[i].travel)
			fail_msg("case %zu: %.17g mm, flags %#x", i, told.target_mm,
				 tick.flags);
		assert_true(tick.actuated_N == cases[i].force_N[2]);
		assert_true(tick.rendered_N == 0.25);
	}
}

/* Where the actuator does not measure its handle, the tracker does. */
static void test_the_pose_says_where_the_handle_is(void **state)
{
	static const struct {
		double tool_mm[3], nut_mm;
		unsigned int flags;
		double target_mm, rendered_N;
	} ticks[] = {
		/* No pose yet: the spring is at rest where the nut is, and 1 N is 0.5 mm. */
		{{0, 0, 99}, 4, INCISE_TICK_STALE, 4.5, 0},
		/* 13 mm along the axis is 3 mm from its origin. */
		{{7, -8, 13}, 4, 0, 3.5, 2},
		{{0, 0, 15}, 4, 0, 5.5, -2},
		/* A pose that is too old, or is none, changes nothing. */
		{{0, 0, 18}, 4, INCISE_TICK_STALE, 5.5, -2},
		{{0, 0, NAN}, 4, 0, 5.5, -2},
	};
	struct told told;
	struct incise_plan plan = plan_on(&told);

	plan.actuator.measures_handle = false;
	plan.actuator.origin_mm = 10;
	plan.limit.last_N[2] = 1;
	told.status.handle_mm = told.status.force_N = NAN;
	for (size_t i = 0; i < sizeof(ticks) / sizeof(*ticks); i++) {
		struct incise_tick tick = {.flags = ticks[i].flags};

		memcpy(tick.tool_mm, ticks[i].tool_mm, sizeof(tick.tool_mm));
		told.status.position_mm = ticks[i].nut_mm;
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		assert_true(told.target_mm == ticks[i].target_mm);
		assert_true(tick.rendered_N == ticks[i].rendered_N);
	}
}

/* What is latched ends the ticks, and is said. */
static void test_a_fault_of_the_actuator_is_named(void **state)
{
	static const struct {
		int status_rc, set_rc;
		unsigned int faults;
		enum incise_stepper_state state;
		const char *says, *own; /* own: what the device tells of its fault */
	} cases[] = {
		{0, -EIO, INCISE_STEPPER_ESTOP | INCISE_STEPPER_TRAVEL,
		 INCISE_STEPPER_FAULT, "e-stop: release it", NULL},
		{0, -EIO, INCISE_STEPPER_ALARM, INCISE_STEPPER_FAULT, "alarm of",
		 "over-voltage (3210h)"},
		{0, -EIO, 0, INCISE_STEPPER_DISABLED, "no power: enable it", NULL},
		{-ENODEV, 0, INCISE_STEPPER_GONE, INCISE_STEPPER_FAULT,
		 "the device went away", NULL},
		{-EIO, 0, 0, INCISE_STEPPER_READY, "Input/output error", NULL},
		/* Another device failed: what the actuator may have is not why. */
		{-EIO, 0, 0, INCISE_STEPPER_READY, "Input/output error", "of last week"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct told told;
		struct incise_plan plan = plan_on(&told);
		struct incise_tick tick = {0};
		const char *own = cases[i].faults ? cases[i].own : NULL;
		char text[200] = "untouched";
		int length;

		assert_null(incise_plan_fault(&plan));
		assert_int_equal(incise_plan_cause(&plan, text, sizeof(text)), 0);
		assert_string_equal(text, "");
		told.rc = cases[i].status_rc;
		told.set_rc = cases[i].set_rc;
		told.status.faults = cases[i].faults;
		told.status.state = cases[i].state;
		told.cause = cases[i].own;
		plan.fault = incise_stage_actuate(&plan, &tick);
		assert_int_equal(plan.fault, cases[i].status_rc + cases[i].set_rc);
		if (!strstr(incise_plan_fault(&plan), cases[i].says))
			fail_msg("case %zu: %s", i, incise_plan_fault(&plan));
		length = incise_plan_cause(&plan, text, sizeof(text));
		assert_int_equal(length, strlen(text));
		assert_string_equal(text, own ? own : incise_plan_fault(&plan));
	}
}

static void test_an_actuator_that_lies_or_fails(void **state)
{
	struct told told;
	struct incise_plan plan = plan_on(&told);
	struct incise_tick tick = {0};

	/* Without a number the handle is where it was. */
	plan.handle_mm = 7;
	plan.limit.last_N[2] = 1;
	told.status.handle_mm = NAN;
	told.status.force_N = INFINITY;
	assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
	assert_true(told.target_mm == 7.5 && tick.rendered_N == 0);
	told.rc = -EIO;
	assert_int_equal(incise_stage_actuate(&plan, &tick), -EIO);
	assert_int_equal(told.sets, 1);
}

static void test_each_limit_is_an_event_of_its_own(void **state)
{
	static const struct {
		double asked_N[3];
		unsigned int flags;
	} cases[] = {
		{{0, 0, 0.5}, 0},
		{{0, 0, 1.5}, INCISE_TICK_SLEWED},
		{{0, 0, 9}, INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED},
		{{0, NAN, 0}, INCISE_TICK_NOT_FINITE},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_guard guard = {0};
		struct incise_plan plan = {.guard = &guard,
					   .limit = {.force_N = 3, .slew_N = 1}};
		struct incise_tick tick = {0};

		memcpy(tick.command_N, cases[i].asked_N, sizeof(tick.command_N));
		assert_int_equal(incise_stage_limit(&plan, &tick), 0);
		assert_int_equal(tick.flags, cases[i].flags);
		/* The guard counts what is sent, not what was asked for. */
		assert_true(guard.watching);
		assert_memory_equal(guard.force_N, tick.command_N, sizeof(guard.force_N));
	}
}

static void test_without_poses_the_last_force_fades(void **state)
{
	struct incise_plan plan = {
		.force_N = {0, 0, 2},
		.start = {.small_N = 3, .ramp_s = 0.01, .fade_s = 0.01},
	};
	double last = 0;

	/* Ticks of 1 ms: ten up, ten down; the first tick has no time. */
	for (int i = 0; i <= 24; i++) {
		struct incise_tick tick = {
			.t_ns = 1000000000 + i * 1000000,
			.flags = i > 12 ? INCISE_TICK_STALE : 0,
		};
		double want = 2 * (i <= 12 ? fmin(i, 10) : fmax(22 - i, 0)) / 10;

		assert_int_equal(incise_stage_start(&plan, &tick), 0);
		/* Ten sums of 0.1. */
		assert_true(fabs(tick.command_N[2] - want) < 1e-14);
		/* At the tenth the sum may be an ulp below 1. */
		if (i != 10)
			assert_int_equal(!!(tick.flags & INCISE_TICK_STARTING),
					 i < 10 || i > 12);
		last = tick.command_N[2];
	}
	assert_true(last == 0);
}

static void test_a_leap_is_no_work(void **state)
{
	for (int leaps = 0; leaps < 2; leaps++) {
		struct incise_guard guard;
		struct incise_plan plan = {
			.guard = &guard,
			.instrument = {.held = INCISE_TOOL_BLADE},
			.predict = {.leaps = leaps},
		};
		const double force_N[3] = {0, 0, 1};
		struct incise_tick tick = {0};

		incise_guard_init(&guard, 0.05, 0.001, 10);
		/* The first place, at 0, and a force held from there on. */
		incise_guard_apply(&guard, tick.tool_mm, plan.velocity_mm_s,
				   plan.force_N);
		incise_guard_sent(&guard, force_N);
		tick.tool_mm[2] = 5;
		assert_int_equal(incise_stage_guard(&plan, &tick), 0);
		/* 1 N along 5 mm came out, unless nobody went that way. */
		assert_true(guard.energy_N_mm == (leaps ? 0 : -5));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_nut_goes_where_its_spring_gives_the_force),
		cmocka_unit_test(test_the_pose_says_where_the_handle_is),
		cmocka_unit_test(test_a_fault_of_the_actuator_is_named),
		cmocka_unit_test(test_an_actuator_that_lies_or_fails),
		cmocka_unit_test(test_each_limit_is_an_event_of_its_own),
		cmocka_unit_test(test_without_poses_the_last_force_fades),
		cmocka_unit_test(test_a_leap_is_no_work),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
