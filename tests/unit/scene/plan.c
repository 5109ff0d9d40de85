// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The plan at work: against the virtual rig's truth, and with devices that lie or fail.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <incise/fixed.h>
#include <incise/sim.h>
#include "felt.h"

#define LIMITED (INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED)
#define BOTH (INCISE_RIG_TRACKER | INCISE_RIG_STEPPER)

/* Run the rig's clock on by 1 ms and tick. */
static int tick(struct felt *f, struct incise_tick *result)
{
	struct incise_clock *clock = incise_rig_clock(f->rig);

	incise_clock_wait_until(clock, incise_clock_now(clock) + 1000000);
	return incise_plan_tick(f->plan, incise_clock_now(clock), result);
}

static double size(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void test_stages(void **state)
{
	static const char *const want[] = {"pose",  "predict", "contact", "reaction",
					   "start", "limit",   "actuate"};
	struct felt f;

	for (int stepper = 0; stepper < 2; stepper++) {
		felt_start(&f, "fixed", stepper ? BOTH : INCISE_RIG_TRACKER);
		for (int i = 0; i < 6 + stepper; i++)
			assert_string_equal(incise_plan_stage(f.plan, i), want[i]);
		assert_null(incise_plan_stage(f.plan, 6 + stepper));
		assert_null(incise_plan_stage(f.plan, -1));
		felt_end(&f);
	}
}

static void test_needs_a_tracker(void **state)
{
	struct incise_error err = {0};
	struct incise_rig *none =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_FORCE, NULL);
	struct felt f;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_null(incise_plan_new(f.scene, none, &err));
	assert_int_equal(err.code, ENODEV);
	incise_rig_close(none);
	felt_end(&f);
}

/* One whole cut of the virtual surgeon, in both arithmetics. */
static void test_against_truth(void **state)
{
	static const char *const arithmetics[] = {"double", "fixed"};

	for (int a = 0; a < 2; a++) {
		struct incise_model *model;
		double depth = 0, render = 0, last_N = 0;
		int contacts = 0, limited = 0;
		struct felt f;

		felt_start(&f, arithmetics[a], BOTH);
		model = incise_model_load(f.model_path, NULL);
		for (int i = 0; i < 9500; i++) {
			struct incise_sim_truth truth;
			struct incise_tick t;
			double x[2], want;

			assert_int_equal(tick(&f, &t), 0);
			incise_sim_truth(incise_rig_sim(f.rig), &truth);
			if (i < 100)
				continue;
			assert_false(t.flags & INCISE_TICK_STALE);
			depth += pow(t.depth_mm - truth.depth_mm, 2) / 9400;
			render += pow(t.rendered_N - last_N, 2) / 9400;
			last_N = size(t.command_N);
			limited += !!(t.flags & LIMITED);
			/* Within leave_mm above the surface a contact has no depth, and no force. */
			if (!(t.flags & INCISE_TICK_CONTACT) || !(t.depth_mm > 0))
				continue;
			contacts++;
			/* Along the outward normal, never pulling. */
			assert_true(t.command_N[0] == 0 && t.command_N[1] == 0);
			assert_true(t.command_N[2] >= 0);
			x[0] = t.depth_mm;
			x[1] = t.velocity_mm_s;
			want = incise_model_eval(model, x, NULL);
			/* 50 µN between the arithmetics; a jump at contact meets the slew. */
			if (!(t.flags & LIMITED))
				assert_true(fabs(t.command_N[2] - want) < 50e-6);
		}
		assert_true(contacts > 6000);
		assert_true(limited < 20);
		/* Tracker noise is 0.02 mm a record; the surgeon brakes and starts. */
		assert_true(sqrt(depth) < 0.06);
		/* At each tracker record the velocity, and so the command, jumps by some 3 mm/s
		 * × 0.01 N·s/mm = 30 mN, which the nut (60 mN a tick) follows a tick later. */
		assert_true(sqrt(render) < 0.03);
		incise_model_free(model);
		felt_end(&f);
	}
}

static uint64_t noise = 1;

static int lying_tracker(struct incise_tracker *tracker,
			 struct incise_tracker_sample *samples, int n)
{
	static int64_t t_ns = 1000000000;

	for (int i = 0; i < 2 && i < n; i++) {
		samples[i] = (struct incise_tracker_sample){.quaternion = {1}};
		for (int k = 0; k < 3; k++) {
			union {
				uint64_t bits;
				double value;
			} u;

			/* Any bit pattern, or a jump of some metres. */
			noise = noise * 6364136223846793005u + 1442695040888963407u;
			u.bits = noise;
			samples[i].position_mm[k] =
				noise >> 63 ? u.value
					    : (double)(noise >> 40) / 1000 - 8000;
		}
		t_ns += 500000;
		samples[i].t_ns = noise % 50 ? t_ns : (int64_t)noise;
	}
	return 2;
}

static void test_any_pose_gives_a_force_within_limits(void **state)
{
	static const char *const arithmetics[] = {"double", "fixed"};

	for (int a = 0; a < 2; a++) {
		struct incise_tracker_ops ops;
		double last = 0;
		int contacts = 0;
		struct felt f;

		felt_start(&f, arithmetics[a], BOTH);
		ops = *f.tracker_ops;
		ops.read = lying_tracker;
		incise_rig_tracker(f.rig)->ops = &ops;
		for (int i = 0; i < 30000; i++) {
			struct incise_tick t;
			double force;

			assert_int_equal(tick(&f, &t), 0);
			force = size(t.command_N);
			assert_true(isfinite(force) && force <= FELT_LIMIT_N);
			assert_true(fabs(force - last) <= FELT_SLEW_N_S / 1000 + 1e-12);
			assert_true(isfinite(t.depth_mm) && isfinite(t.velocity_mm_s));
			assert_true(isfinite(t.rendered_N));
			last = force;
			contacts += t.flags & INCISE_TICK_CONTACT;
		}
		/* The test did press on the tissue. */
		assert_true(contacts > 1000);
		felt_end(&f);
	}
}

static int silent_tracker(struct incise_tracker *tracker,
			  struct incise_tracker_sample *samples, int n)
{
	return 0;
}

/* 4 s into the cut the blade is in the tissue. */
static void press(struct felt *f)
{
	struct incise_tick t;

	for (int i = 0; i < 4000; i++)
		assert_int_equal(tick(f, &t), 0);
	assert_true(t.flags & INCISE_TICK_CONTACT);
	assert_true(t.command_N[2] > 0.1);
}

static void test_stalled_tracker_fades_out(void **state)
{
	struct incise_tracker_ops ops;
	struct incise_tick t;
	struct felt f;
	int zero_at = 0;

	felt_start(&f, "fixed", BOTH);
	press(&f);
	ops = *f.tracker_ops;
	ops.read = silent_tracker;
	incise_rig_tracker(f.rig)->ops = &ops;
	for (int i = 1; i <= 200; i++) {
		assert_int_equal(tick(&f, &t), 0);
		if (!zero_at && size(t.command_N) == 0)
			zero_at = i;
	}
	assert_true(t.flags & INCISE_TICK_STALE);
	/* pose_age_ms of 50, then the slew takes at most 3 N / (0.3 N a tick). */
	assert_in_range(zero_at, 30, 50 + 10 + 1);
	/* And it comes back when poses do. */
	incise_rig_tracker(f.rig)->ops = f.tracker_ops;
	for (int i = 0; i < 50; i++)
		assert_int_equal(tick(&f, &t), 0);
	assert_true(size(t.command_N) > 0.1);
	felt_end(&f);
}

static int gone_tracker(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	return -ENODEV;
}

static int gone_stepper(struct incise_stepper *stepper,
			struct incise_stepper_status *status)
{
	return -EIO;
}

static void test_fault_is_zero_force_for_good(void **state)
{
	for (int which = 0; which < 2; which++) {
		struct incise_tracker_ops tracker;
		struct incise_stepper_ops stepper;
		struct incise_tick t;
		struct felt f;
		int want = which ? -EIO : -ENODEV;

		felt_start(&f, "fixed", BOTH);
		press(&f);
		tracker = *f.tracker_ops;
		tracker.read = gone_tracker;
		stepper = *f.stepper_ops;
		stepper.status = gone_stepper;
		if (which)
			incise_rig_stepper(f.rig)->ops = &stepper;
		else
			incise_rig_tracker(f.rig)->ops = &tracker;
		assert_int_equal(tick(&f, &t), want);
		assert_true(size(t.command_N) == 0);
		assert_true(t.flags & INCISE_TICK_FAULT);
		/* The device's return does not bring the force back. */
		incise_rig_tracker(f.rig)->ops = f.tracker_ops;
		incise_rig_stepper(f.rig)->ops = f.stepper_ops;
		for (int i = 0; i < 500; i++) {
			struct incise_stepper_status status;

			assert_int_equal(tick(&f, &t), want);
			assert_true(size(t.command_N) == 0);
			assert_int_equal(incise_stepper_status(incise_rig_stepper(f.rig),
							       &status),
					 0);
			/* The nut stood at 1.1 mm or less for 0.75 N: home in 37 ms at
			 * 30 mm/s, then the handle follows within some b/k = 10 ms. */
			if (i >= 90)
				assert_true(fabs(status.force_N) < 0.02);
			/* Meanwhile the handle lags behind: 30 mm/s × 0.01 N·s/mm. */
			assert_true(status.force_N > -0.3);
		}
		felt_end(&f);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_stages),
		cmocka_unit_test(test_needs_a_tracker),
		cmocka_unit_test(test_against_truth),
		cmocka_unit_test(test_any_pose_gives_a_force_within_limits),
		cmocka_unit_test(test_stalled_tracker_fades_out),
		cmocka_unit_test(test_fault_is_zero_force_for_good),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
