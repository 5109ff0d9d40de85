// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/scene/stages.c, stage by stage, on a plan made by hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/backend.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"

static const struct incise_tracker_info info = {.rate_hz = 100, .latency_ns = 5000000};

static int read_rc;

static int told_read(struct incise_tracker *tracker,
		     struct incise_tracker_sample *samples, int n)
{
	if (read_rc < 0)
		return read_rc;
	samples[0] = (struct incise_tracker_sample){
		.t_ns = INT64_MAX,
		.position_mm = {1, 2, 3},
		.quaternion = {1},
	};
	return 1;
}

static const struct incise_tracker_ops ops = {.read = told_read};

static void test_poses_of_the_future_are_of_now(void **state)
{
	struct incise_tracker tracker = {.ops = &ops};
	struct incise_plan plan = {.tracker = &tracker, .pose_age_ns = 20000000};
	struct incise_tick tick = {.t_ns = 1000000000};

	incise_predict_init(&plan.predict, &info, 0);
	read_rc = 0;
	assert_int_equal(incise_stage_pose(&plan, &tick), 0);
	assert_int_equal(plan.predict.t_ns, tick.t_ns - info.latency_ns);
	assert_int_equal(incise_stage_predict(&plan, &tick), 0);
	assert_int_equal(tick.flags, 0);
	assert_true(tick.position_mm[2] == 3 && tick.tool_mm[2] == 3);
	/* A pose is 5 ms old when it comes, and stale from 20 ms on. */
	tick.t_ns += 15000000;
	incise_stage_predict(&plan, &tick);
	assert_int_equal(tick.flags, 0);
	tick.t_ns += 1;
	incise_stage_predict(&plan, &tick);
	assert_int_equal(tick.flags, INCISE_TICK_STALE);
	read_rc = -ENODEV;
	assert_int_equal(incise_stage_pose(&plan, &tick), -ENODEV);
}

/* A quarter turn about x takes the tip's y to z. */
static void test_tip_of_the_calibration(void **state)
{
	struct incise_tracker_sample sample = {
		.t_ns = 1000000000,
		.position_mm = {1, 2, 3},
		.quaternion = {M_SQRT1_2, M_SQRT1_2},
	};
	struct incise_plan plan = {.pose_age_ns = 20000000, .fed = &sample, .n_fed = 1};
	struct incise_tick tick = {.t_ns = 1000000000};
	const double tip_mm[3] = {10, 20, 0}, huge[3] = {1e7}, none[3] = {NAN};

	assert_int_equal(incise_plan_set_tip(&plan, huge), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, none), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, tip_mm), 0);
	incise_predict_init(&plan.predict, &info, 0);
	incise_stage_fed(&plan, &tick);
	incise_stage_predict(&plan, &tick);
	/* rounding of the quarter turn */
	assert_true(fabs(tick.position_mm[0] - 11) < 1e-12);
	assert_true(fabs(tick.position_mm[1] - 2) < 1e-12);
	assert_true(fabs(tick.position_mm[2] - 23) < 1e-12);
}

/* A plan over the plane z = 0, the blade 1 mm above it. */
static struct incise_plan plan_over(struct incise_surface *surface)
{
	struct incise_plan plan = {
		.surface = surface,
		.attitude = {M_SQRT1_2, 0, 0, M_SQRT1_2},
		.instrument = {.side = {0, 1, 0}, .held = INCISE_TOOL_BLADE},
		.force_N = {1, 1, 1},
	};
	struct incise_tick tick = {.tool_mm = {0, 0, 1}};

	incise_proxy_init(&plan.proxy, surface, 0.5);
	incise_stage_contact(&plan, &tick);
	assert_int_equal(tick.phase, INCISE_PHASE_FREE);
	return plan;
}

static struct incise_surface *ground(void)
{
	static const double point[3] = {0}, up[3] = {0, 0, 1};

	return incise_surface_new_plane(point, up, NULL);
}

static void test_a_cut_from_its_begin_to_its_end(void **state)
{
	static const struct {
		double z_mm, depth_mm;
		bool contact;
	} way[] = {{-1, 1, true},  {-3, 3, true},      {0, 0, true},
		   {0.5, 0, true}, {0.5001, 0, false}, {0.25, 0, false}};
	struct incise_surface *surface = ground();
	struct incise_plan plan = plan_over(surface);

	for (size_t i = 0; i < sizeof(way) / sizeof(*way); i++) {
		struct incise_tick tick = {.tool_mm = {2.0 * i, 0, way[i].z_mm}};

		plan.force_N[0] = 5;
		assert_int_equal(incise_stage_contact(&plan, &tick), 0);
		/* Each tick's force starts with none. */
		assert_true(v3_length(plan.force_N) == 0);
		assert_int_equal(tick.phase == INCISE_PHASE_CUTTING, way[i].contact);
		assert_int_equal(!!(tick.flags & INCISE_TICK_CONTACT), way[i].contact);
		assert_true(tick.depth_mm == way[i].depth_mm);
	}
	/* It came in at 0, half way down from 1 to -1. */
	assert_true(v3_length(plan.p0_mm) < 1e-15);
	/* A quarter turn about z: the blade's side lies along -x, its cut along y, and
	 * the way along x does not make it longer. */
	assert_true(fabs(plan.line.side[0] + 1) < 1e-15);
	assert_true(fabs(fabs(plan.line.along[1]) - 1) < 1e-15);
	assert_true(fabs(plan.line.to_mm - plan.line.from_mm) < 1e-14);
	incise_surface_free(surface);
}

static void test_an_instrument_leaves_no_cut(void **state)
{
	struct incise_surface *surface = ground();
	struct incise_plan plan = plan_over(surface);
	struct incise_tick tick = {.tool_mm = {0, 0, -1}};

	plan.instrument.held = INCISE_TOOL_TUBE;
	assert_int_equal(incise_stage_contact(&plan, &tick), 0);
	assert_int_equal(tick.phase, INCISE_PHASE_INSERTION);
	assert_int_equal(tick.tool, INCISE_TOOL_TUBE);
	assert_false(plan.line.there);
	incise_surface_free(surface);
}

/* Another tool in the hand, also while no poses come: its end is where it is said to be. */
static void test_the_end_of_what_is_held(void **state)
{
	struct incise_surface *surface = ground();
	struct incise_predict handle;
	struct incise_tracker_sample pose = {.t_ns = 1000000000,
					     .position_mm = {0, 0, 50},
					     .quaternion = {0, 1, 0, 0}};
	struct incise_plan plan = {
		.surface = surface,
		.handle = &handle,
		.inserts = true,
		.fed = &pose,
		.n_fed = 1,
		.up = {0, 0, 1},
		.pose_age_ns = 20000000,
		.instrument = {.axis = {0, 0, 1},
			       .side = {0, 1, 0},
			       .handle_mm = 40,
			       .held = INCISE_TOOL_BLADE},
	};

	incise_predict_init(&plan.predict, &info, 0);
	incise_predict_init(&handle, &info, 0);
	incise_proxy_init(&plan.proxy, surface, 0.5);
	for (int late = 0; late < 2; late++) {
		struct incise_tick tick = {.t_ns = 1000000000 + late * 100000000};

		incise_stage_fed(&plan, &tick);
		incise_stage_predict(&plan, &tick);
		incise_stage_tool(&plan, &tick);
		assert_int_equal(!!(tick.flags & INCISE_TICK_STALE), late);
		/* Upside down: the handle is 40 mm below the tip. */
		assert_int_equal(tick.tool, INCISE_TOOL_HANDLE);
		assert_true(tick.position_mm[2] == 50);
		assert_true(fabs(tick.tool_mm[2] - 10) < 1e-13);
	}
	incise_surface_free(surface);
}

/* An actuator that keeps its requests, and reports the status that a test gives it. */
struct reported {
	struct incise_stepper stepper;
	struct incise_stepper_status status;
	int rc, set_rc, sets;
	const char *cause;
	double target_mm;
};

static int told_set(struct incise_stepper *stepper, double position_mm)
{
	struct reported *reported = (struct reported *)stepper;

	reported->sets++;
	reported->target_mm = position_mm;
	return reported->set_rc;
}

static int told_status(struct incise_stepper *stepper,
		       struct incise_stepper_status *status)
{
	struct reported *reported = (struct reported *)stepper;

	*status = reported->status;
	return reported->rc;
}

static int told_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	const char *cause = ((struct reported *)stepper)->cause;

	return cause ? snprintf(text, size, "%s", cause) : 0;
}

static const struct incise_stepper_ops stepper_ops = {
	.set = told_set, .status = told_status, .cause = told_cause};

/* A spring of 2 N/mm and a travel of 20 mm, pushing along z. */
static struct incise_plan plan_on(struct reported *reported)
{
	*reported = (struct reported){.stepper = {.ops = &stepper_ops}};
	return (struct incise_plan){
		.stepper = &reported->stepper,
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
		struct reported reported;
		struct incise_plan plan = plan_on(&reported);
		struct incise_tick tick = {0};

		reported.status.handle_mm = cases[i].handle_mm;
		reported.status.force_N = 0.25;
		memcpy(plan.limit.last_N, cases[i].force_N, sizeof(plan.limit.last_N));
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		/* Sums and quotients of small decimals: some ulp of 20. */
		if (!(fabs(reported.target_mm - cases[i].target_mm) < 1e-14) ||
		    !!(tick.flags & INCISE_TICK_TRAVEL) != cases[i].travel)
			fail_msg("case %zu: %.17g mm, flags %#x", i, reported.target_mm,
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
	struct reported reported;
	struct incise_plan plan = plan_on(&reported);

	plan.actuator.measures_handle = false;
	plan.actuator.origin_mm = 10;
	plan.limit.last_N[2] = 1;
	reported.status.handle_mm = reported.status.force_N = NAN;
	for (size_t i = 0; i < sizeof(ticks) / sizeof(*ticks); i++) {
		struct incise_tick tick = {.flags = ticks[i].flags};

		memcpy(tick.tool_mm, ticks[i].tool_mm, sizeof(tick.tool_mm));
		reported.status.position_mm = ticks[i].nut_mm;
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		assert_true(reported.target_mm == ticks[i].target_mm);
		assert_true(tick.rendered_N == ticks[i].rendered_N);
	}
}

/* A latched fault ends the ticks, and is reported. */
static void test_a_fault_of_the_actuator_is_named(void **state)
{
	static const struct {
		int status_rc, set_rc;
		unsigned int faults;
		enum incise_stepper_state state;
		const char *says, *own; /* own: the device's description of its fault */
	} cases[] = {
		{0, -EIO, INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_TRAVEL,
		 INCISE_STEPPER_STATE_FAULT, "e-stop: release it", NULL},
		{0, -EIO, INCISE_STEPPER_FAULT_ALARM, INCISE_STEPPER_STATE_FAULT,
		 "alarm of", "over-voltage (3210h)"},
		{0, -EIO, 0, INCISE_STEPPER_STATE_DISABLED, "no power: enable it", NULL},
		{-ENODEV, 0, INCISE_STEPPER_FAULT_GONE, INCISE_STEPPER_STATE_FAULT,
		 "the device went away", NULL},
		{-EIO, 0, 0, INCISE_STEPPER_STATE_READY, "Input/output error", NULL},
		/* Another device failed: what the actuator may have is not why. */
		{-EIO, 0, 0, INCISE_STEPPER_STATE_READY, "Input/output error",
		 "of last week"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct reported reported;
		struct incise_plan plan = plan_on(&reported);
		struct incise_tick tick = {0};
		const char *own = cases[i].faults ? cases[i].own : NULL;
		char text[200] = "untouched";
		int length;

		assert_null(incise_plan_fault(&plan));
		assert_int_equal(incise_plan_cause(&plan, text, sizeof(text)), 0);
		assert_string_equal(text, "");
		reported.rc = cases[i].status_rc;
		reported.set_rc = cases[i].set_rc;
		reported.status.faults = cases[i].faults;
		reported.status.state = cases[i].state;
		reported.cause = cases[i].own;
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
	struct reported reported;
	struct incise_plan plan = plan_on(&reported);
	struct incise_tick tick = {0};

	/* Without a number the handle is where it was. */
	plan.handle_mm = 7;
	plan.limit.last_N[2] = 1;
	reported.status.handle_mm = NAN;
	reported.status.force_N = INFINITY;
	assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
	assert_true(reported.target_mm == 7.5 && tick.rendered_N == 0);
	reported.rc = -EIO;
	assert_int_equal(incise_stage_actuate(&plan, &tick), -EIO);
	assert_int_equal(reported.sets, 1);
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
		struct incise_plan plan = {.limit = {.force_N = 3, .slew_N = 1}};
		struct incise_tick tick = {0};

		memcpy(tick.command_N, cases[i].asked_N, sizeof(tick.command_N));
		assert_int_equal(incise_stage_limit(&plan, &tick), 0);
		assert_int_equal(tick.flags, cases[i].flags);
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_poses_of_the_future_are_of_now),
		cmocka_unit_test(test_tip_of_the_calibration),
		cmocka_unit_test(test_a_cut_from_its_begin_to_its_end),
		cmocka_unit_test(test_an_instrument_leaves_no_cut),
		cmocka_unit_test(test_the_end_of_what_is_held),
		cmocka_unit_test(test_the_nut_goes_where_its_spring_gives_the_force),
		cmocka_unit_test(test_the_pose_says_where_the_handle_is),
		cmocka_unit_test(test_a_fault_of_the_actuator_is_named),
		cmocka_unit_test(test_an_actuator_that_lies_or_fails),
		cmocka_unit_test(test_each_limit_is_an_event_of_its_own),
		cmocka_unit_test(test_without_poses_the_last_force_fades),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
