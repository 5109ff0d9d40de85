// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/scene/actuate.c, and the duals of lib/rig/axes.c: one actuator on a plan made by hand,
 * then several against an independent least-squares solution.
 */
#include "../unit.h"
#include <incise/backend.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/rig/axes.h"
#include "../../../lib/scene/plan.h"
#include "../message.h"

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
	.set = told_set,
	.status = told_status,
	.cause = told_cause,
};

/* A spring of 2 N/mm and a travel of 20 mm, pushing along z. */
static struct incise_plan plan_on(struct reported *reported)
{
	*reported = (struct reported){.stepper = {.ops = &stepper_ops}};
	return (struct incise_plan){
		.axes = {.axis = {{.stepper = &reported->stepper,
				   .info = {.spring_N_mm = 2,
					    .travel_mm = 20,
					    .step_mm = 0.001,
					    .measures_handle = true},
				   .direction = {0, 0, 1},
				   .dual = {0, 0, 1}}},
			 .n = 1},
	};
}

TEST(test_the_nut_goes_where_its_spring_gives_the_force)
{
	static const struct {
		double handle_mm, force_N[3], target_mm;
		bool travel;
	} cases[] = {
		{5, {0, 0, 0}, 5, false},
		{5, {0, 0, 3}, 6.5, false},
		{5, {0, 0, -3}, 3.5, false},
		/* The part across the axis is not felt. */
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
		memcpy(plan.last_N, cases[i].force_N, sizeof(plan.last_N));
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		/* Sums and quotients of small decimals: some ulp of 20. */
		if (!(fabs(reported.target_mm - cases[i].target_mm) < 1e-14) ||
		    !!(tick.flags & INCISE_TICK_TRAVEL) != cases[i].travel)
			fail_msg("case %zu: %.17g mm, flags %#x", i, reported.target_mm,
				 tick.flags);
		assert_true(tick.actuated_N[0] == cases[i].force_N[2]);
		assert_true(tick.rendered_N[0] == 0.25);
		assert_true(tick.unfelt_N ==
			    hypot(cases[i].force_N[0], cases[i].force_N[1]));
	}
}

/* Where the actuator does not measure its handle, the tracker does. */
TEST(test_the_pose_says_where_the_handle_is)
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

	plan.axes.axis[0].info.measures_handle = false;
	plan.axes.axis[0].info.origin_mm = 10;
	plan.last_N[2] = 1;
	reported.status.handle_mm = reported.status.force_N = NAN;
	for (size_t i = 0; i < sizeof(ticks) / sizeof(*ticks); i++) {
		struct incise_tick tick = {.flags = ticks[i].flags};

		memcpy(tick.tool_mm, ticks[i].tool_mm, sizeof(tick.tool_mm));
		reported.status.position_mm = ticks[i].nut_mm;
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		assert_true(reported.target_mm == ticks[i].target_mm);
		assert_true(tick.rendered_N[0] == ticks[i].rendered_N);
	}
}

/* A latched fault ends the ticks, and is reported. */
TEST(test_a_fault_of_the_actuator_is_named)
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
		{0, -EIO, 0, INCISE_STEPPER_STATE_DISABLED, "off: enable it", NULL},
		{-ENODEV, 0, INCISE_STEPPER_FAULT_GONE, INCISE_STEPPER_STATE_FAULT,
		 "the device was removed", NULL},
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

TEST(test_an_actuator_that_lies_or_fails)
{
	struct reported reported;
	struct incise_plan plan = plan_on(&reported);
	struct incise_tick tick = {0};

	/* Without a number the handle is where it was. */
	plan.axes.axis[0].handle_mm = 7;
	plan.last_N[2] = 1;
	reported.status.handle_mm = NAN;
	reported.status.force_N = INFINITY;
	assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
	assert_true(reported.target_mm == 7.5 && tick.rendered_N[0] == 0);
	reported.rc = -EIO;
	assert_int_equal(incise_stage_actuate(&plan, &tick), -EIO);
	assert_int_equal(reported.sets, 1);
}

/* --- several actuators --- */

/* Deterministic, in -1 … 1. */
static double some(uint64_t *state)
{
	*state = *state * 6364136223846793005U + 1442695040888963407U;
	return (double)(int64_t)*state / 9223372036854775808.0;
}

static void some_unit(uint64_t *state, double to[3])
{
	double v[3];

	do {
		for (int i = 0; i < 3; i++)
			v[i] = some(state);
	} while (v3_length(v) > 1 || !v3_unit(to, v, 0.1));
}

/* n directions, each 30 degrees or more from the span of the others, as rig.conf takes them. */
static void some_directions(uint64_t *state, int n, double direction[][3])
{
	double across[3], least;

	do {
		least = 1;
		for (int i = 0; i < n; i++)
			some_unit(state, direction[i]);
		for (int i = 0; i < n; i++) {
			v3_cross(across, direction[(i + 1) % n], direction[(i + 2) % n]);
			if (n == 2)
				least = 1 - fabs(v3_dot(direction[0], direction[1]));
			else if (n == 3 && v3_unit(across, across, 0.5))
				least = fmin(least, fabs(v3_dot(direction[i], across)));
			else if (n == 3)
				least = 0;
		}
	} while (least < (n == 2 ? 1 - cos(M_PI / 6) : 0.5));
}

/* Reference: the normal equations (AᵀA) f = AᵀF by Gauss with pivots. */
static void least_squares(int n, const double direction[][3], const double force[3],
			  double f[3])
{
	double m[3][4];

	for (int i = 0; i < n; i++) {
		for (int k = 0; k < n; k++)
			m[i][k] = v3_dot(direction[i], direction[k]);
		m[i][n] = v3_dot(direction[i], force);
	}
	for (int i = 0; i < n; i++) {
		int best = i;

		for (int k = i + 1; k < n; k++)
			if (fabs(m[k][i]) > fabs(m[best][i]))
				best = k;
		for (int c = 0; c <= n; c++) {
			double swap = m[i][c];

			m[i][c] = m[best][c];
			m[best][c] = swap;
		}
		for (int k = 0; k < n; k++) {
			double share = m[k][i] / m[i][i];

			for (int c = i; k != i && c <= n; c++)
				m[k][c] -= share * m[i][c];
		}
	}
	for (int i = 0; i < n; i++)
		f[i] = m[i][n] / m[i][i];
}

static void put_axes(struct incise_plan *plan, struct reported *reported, int n,
		     const double direction[][3])
{
	double dual[3][3];

	*plan = (struct incise_plan){.axes.n = n};
	incise_axes_dual(n, direction, dual);
	for (int i = 0; i < n; i++) {
		struct incise_axis *axis = &plan->axes.axis[i];

		*axis = plan_on(&reported[i]).axes.axis[0];
		v3_copy(axis->direction, direction[i]);
		v3_copy(axis->dual, dual[i]);
		axis->info.rest_mm = 10;
		snprintf(axis->info.name, sizeof(axis->info.name), "motor %d", i + 1);
		/* Half way, so that 4 N of a spring of 2 N/mm stay within the travel. */
		reported[i].status.handle_mm = 10;
	}
}

/*
 * A condition of at most 4 (sines of 1/2) times some ulp of 4 N, squared by the reference's
 * normal equations.
 */
#define ROUNDING_N 1e-12

TEST(test_forces_are_the_least_squares_solution)
{
	uint64_t seed = 5;

	for (int k = 0; k < 3000; k++) {
		int n = 1 + k % 3;
		double direction[3][3], force_N[3], f[3], felt_N[3] = {0}, rest_N[3];
		double v[3], power = 0;
		struct reported reported[3];
		struct incise_tick tick = {0};
		struct incise_plan plan;

		some_directions(&seed, n, direction);
		put_axes(&plan, reported, n, direction);
		for (int i = 0; i < 3; i++) {
			force_N[i] = 4 * some(&seed) / sqrt(3);
			v[i] = 100 * some(&seed);
		}
		v3_copy(plan.last_N, force_N);
		assert_int_equal(incise_stage_actuate(&plan, &tick), 0);
		least_squares(n, direction, force_N, f);
		for (int i = 0; i < n; i++) {
			if (!(fabs(tick.actuated_N[i] - f[i]) < ROUNDING_N))
				fail_msg("%d: %.17g, want %.17g", k, tick.actuated_N[i],
					 f[i]);
			/* The spring of each gives it. */
			assert_true(fabs(2 * (reported[i].target_mm - 10) - f[i]) <
				    ROUNDING_N);
			v3_add(felt_N, felt_N, tick.actuated_N[i], direction[i]);
			/* Force of each motor on the hand that moves along it. */
			power += tick.actuated_N[i] * v3_dot(direction[i], v);
		}
		for (int i = n; i < 3; i++)
			assert_true(tick.actuated_N[i] == 0 && tick.rendered_N[i] == 0);
		/* The motors' power is that of the felt force; 100 mm/s. */
		assert_true(fabs(power - v3_dot(felt_N, v)) < 100 * ROUNDING_N);
		/* The rest is at right angles to all that can be felt. */
		v3_sub(rest_N, force_N, felt_N);
		for (int i = 0; i < n; i++)
			assert_true(fabs(v3_dot(rest_N, direction[i])) < ROUNDING_N);
		assert_true(fabs(tick.unfelt_N - v3_length(rest_N)) < ROUNDING_N);
		assert_true(v3_length(felt_N) <= v3_length(force_N) + ROUNDING_N);
		if (n == 3)
			assert_true(tick.unfelt_N < ROUNDING_N);
	}
}

/* To the bit: right angles, and one direction of any rounding. */
TEST(test_no_rounding_where_none_is_needed)
{
	static const double frame[3][3] = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
	double dual[3][3], one[1][3];
	uint64_t seed = 7;

	for (int n = 1; n <= 3; n++) {
		incise_axes_dual(n, frame, dual);
		for (int i = 0; i < n; i++)
			for (int k = 0; k < 3; k++)
				assert_true(dual[i][k] == frame[i][k]);
	}
	for (int i = 0; i < 100; i++) {
		some_unit(&seed, one[0]);
		incise_axes_dual(1, one, dual);
		assert_memory_equal(dual[0], one[0], sizeof(one[0]));
	}
}

/* One of two fails: all go to rest, and it is the one that is named. */
TEST(test_a_fault_of_one_is_the_end_of_all)
{
	static const double frame[2][3] = {{0, 0, 1}, {0, 1, 0}};
	static const struct {
		int which, status_rc, set_rc;
		unsigned int faults;
		enum incise_stepper_state state;
		const char *says;
	} cases[] = {
		{1, 0, -EIO, INCISE_STEPPER_FAULT_LIMIT_MAX, INCISE_STEPPER_STATE_FAULT,
		 "motor 2:"},
		{0, 0, -EIO, INCISE_STEPPER_FAULT_ESTOP, INCISE_STEPPER_STATE_FAULT,
		 "motor 1:"},
		{1, 0, -EIO, 0, INCISE_STEPPER_STATE_DISABLED, "motor 2:"},
		{1, -ENODEV, 0, INCISE_STEPPER_FAULT_GONE, INCISE_STEPPER_STATE_FAULT,
		 "motor 2:"},
		{1, -EIO, 0, 0, INCISE_STEPPER_STATE_READY, "motor 2:"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct reported reported[2], *failing = &reported[cases[i].which];
		struct incise_stage actuate = {.name = "actuate",
					       .run = incise_stage_actuate};
		struct incise_plan plan;
		struct incise_tick tick;
		int want = cases[i].status_rc + cases[i].set_rc;
		char text[200];

		put_axes(&plan, reported, 2, frame);
		plan.ops = incise_double_ops;
		plan.stage[plan.n_stages++] = actuate;
		plan.last_N[1] = plan.last_N[2] = 2;
		assert_int_equal(incise_plan_tick(&plan, 1, &tick), 0);
		assert_true(reported[0].target_mm == 11 && reported[1].target_mm == 11);
		reported[0].sets = reported[1].sets = 0;
		failing->rc = cases[i].status_rc;
		failing->set_rc = cases[i].set_rc;
		failing->status.faults = cases[i].faults;
		failing->status.state = cases[i].state;
		assert_int_equal(incise_plan_tick(&plan, 2, &tick), want);
		for (int k = 0; k < 2; k++) {
			assert_true(tick.actuated_N[k] == 0);
			/* Both are told, also the one that fails. */
			assert_true(reported[k].sets > 0 && reported[k].target_mm == 10);
		}
		assert_true(v3_length(tick.command_N) == 0 && tick.unfelt_N == 0);
		assert_true(tick.flags & INCISE_TICK_FAULT);
		/* An error of reading comes before any target. */
		if (cases[i].status_rc)
			assert_int_equal(reported[0].sets, 1);
		incise_plan_cause(&plan, text, sizeof(text));
		assert_says(text, cases[i].says);
		/* Its return does not bring the force back. */
		failing->rc = failing->set_rc = 0;
		assert_int_equal(incise_plan_tick(&plan, 3, &tick), want);
		assert_true(reported[0].target_mm == 10 && reported[1].target_mm == 10);
	}
}

/* After the last tick: each is released, and a refusal is named. */
TEST(test_all_are_released)
{
	static const double frame[3][3] = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
	struct reported reported[3];
	struct incise_plan plan;
	char text[200];

	put_axes(&plan, reported, 3, frame);
	reported[1].set_rc = -EIO;
	reported[1].status.faults = INCISE_STEPPER_FAULT_DEADMAN;
	assert_int_equal(incise_plan_release(&plan), -EIO);
	for (int i = 0; i < 3; i++)
		assert_true(reported[i].sets == 1 && reported[i].target_mm == 10);
	incise_plan_cause(&plan, text, sizeof(text));
	assert_says(text, "motor 2:");
}
