// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Devices that fail or report nonsense below a plan on the virtual rig: the plan latches the
 * fault with its reason, and asks for no force after it.
 *
 *   tracker ─▶ ?! ─▶ plan ─▶ targets ─▶ ?! ─▶ actuator
 */
#include <errno.h>
#include <stdio.h>
#include <incise/backend.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "../../lib/base/vector.h"
#include "../../lib/scene/plan.h"
#include "../../tools/cli/cli.h"
#include "../../tools/cli/file.h"
#include "extremes.h"
#include "numbers.h"

#define RUNS 1200
#define TICKS 250
#define MS INT64_C(1000000)
#define TRAVEL_mm 20
#define ROUNDING 1e-15 /* of a sum of squares, and its root */

enum failure { FAILS_READ, FAILS_SET, FAILS_STATUS, FAILS_FAULT, FAILS_NEVER };

/* The devices of the run; ops have no context. */
static struct hostile {
	const struct incise_tracker_ops *tracker;
	const struct incise_stepper_ops *stepper;
	int axes, axis; /* of the rig; the one that fails */
	struct incise_tracker_ops tracker_ops;
	struct incise_stepper_ops stepper_ops;
	int fails_at; /* ticks until it fails; below 0: never */
	int rc;	      /* with that */
	enum failure what;
	unsigned int faults;
	bool nonsense;	  /* numbers that cannot be */
	double target_mm; /* the last one */
	bool beyond;	  /* a target that cannot be */
} hostile;

static bool fails(enum failure what)
{
	return hostile.fails_at <= 0 && hostile.what == what;
}

static int hostile_read(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	int got = hostile.tracker->read(tracker, samples, n);

	if (fails(FAILS_READ))
		return hostile.rc;
	for (int i = 0; hostile.nonsense && i < got; i++)
		if (!below(4)) {
			for (int a = 0; a < 3; a++)
				samples[i].position_mm[a] = special();
			any_attitude(samples[i].quaternion);
			samples[i].t_ns = below(4) ? samples[i].t_ns : (int64_t)any();
		}
	return got;
}

static int hostile_set(struct incise_stepper *stepper, double position_mm)
{
	hostile.target_mm = position_mm;
	hostile.beyond |= !(position_mm >= 0 && position_mm <= TRAVEL_mm);
	if (fails(FAILS_SET) || fails(FAILS_FAULT))
		return fails(FAILS_FAULT) ? -EIO : hostile.rc;
	return hostile.stepper->set(stepper, position_mm);
}

static int hostile_status(struct incise_stepper *stepper,
			  struct incise_stepper_status *status)
{
	int rc = hostile.stepper->status(stepper, status);

	if (fails(FAILS_STATUS))
		return hostile.rc;
	if (fails(FAILS_FAULT)) {
		status->faults |= hostile.faults;
		status->state = INCISE_STEPPER_STATE_FAULT;
	}
	if (hostile.nonsense && !below(4)) {
		status->position_mm = special();
		status->handle_mm = special();
		status->force_N = special();
		status->velocity_mm_s = special();
	}
	return rc;
}

static void take_devices(struct incise_rig *rig)
{
	struct incise_tracker *tracker = incise_rig_tracker(rig);
	struct incise_stepper *stepper = incise_rig_stepper(rig);

	/* The virtual actuators' functions are the same. */
	hostile.tracker = tracker->ops;
	hostile.tracker_ops = *tracker->ops;
	hostile.tracker_ops.read = hostile_read;
	tracker->ops = &hostile.tracker_ops;
	hostile.stepper = stepper->ops;
	hostile.stepper_ops = *stepper->ops;
	hostile.stepper_ops.set = hostile_set;
	hostile.stepper_ops.status = hostile_status;
	for (int i = 0; i < hostile.axes; i++)
		if (i == hostile.axis || hostile.nonsense)
			incise_rig_axis(rig, i, NULL)->ops = &hostile.stepper_ops;
}

static void give_back_devices(struct incise_rig *rig)
{
	incise_rig_tracker(rig)->ops = hostile.tracker;
	for (int i = 0; i < hostile.axes; i++)
		incise_rig_axis(rig, i, NULL)->ops = hostile.stepper;
}

static void prepare(bool nonsense)
{
	static const int codes[] = {EIO, ENODEV, EDOM, EPERM, ETIMEDOUT, EPROTO};

	hostile.nonsense = nonsense;
	hostile.what = nonsense ? FAILS_NEVER : (enum failure)below(4);
	hostile.fails_at = (int)below(TICKS - 10);
	hostile.rc = -codes[below(6)];
	hostile.faults = 1U << below(INCISE_STEPPER_FAULTS);
	/* Held within the travel is none. */
	if (hostile.faults == INCISE_STEPPER_FAULT_TRAVEL)
		hostile.faults = INCISE_STEPPER_FAULT_ESTOP;
	hostile.beyond = false;
}

static bool finite_tick(const struct incise_tick *t, double limit_N)
{
	return v3_finite(t->position_mm) && v3_finite(t->tool_mm) &&
	       v3_length(t->command_N) <= limit_N && v3_finite(t->rendered_N) &&
	       v3_length(t->actuated_N) <= limit_N * (1 + ROUNDING) &&
	       t->unfelt_N <= limit_N * (1 + ROUNDING) && isfinite(t->depth_mm);
}

/* @failed: what a tick before returned. */
static bool is_right(struct incise_plan *plan, int rc, int failed,
		     const struct incise_tick *t)
{
	const char *why = incise_plan_fault(plan);
	bool must = hostile.fails_at <= 0 && hostile.what != FAILS_NEVER;
	char cause[200];

	if (hostile.beyond || !finite_tick(t, 4))
		return false;
	if (!must)
		return !rc && !failed && !why;
	return rc < 0 && (!failed || rc == failed) && v3_length(t->command_N) == 0 &&
	       (t->flags & INCISE_TICK_FAULT) && why && *why &&
	       incise_plan_cause(plan, cause, sizeof(cause)) > 0;
}

static void run(struct extremes_row *row, const struct incise_scene *scene, bool nonsense)
{
	char spec[100];
	struct incise_error err = {0};
	struct incise_tick tick;
	struct incise_plan *plan;
	struct incise_clock *clock;
	struct incise_rig *rig;
	int failed = 0;

	hostile.axes = 1 + (int)below(INCISE_RIG_AXES_MAX);
	hostile.axis = (int)below((unsigned int)hostile.axes);
	snprintf(spec, sizeof(spec),
		 "sim:clock=simulated,seed=%u,pause_s=0.1,cut_s=1,axes=%d",
		 1 + below(1000), hostile.axes);
	rig = incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, &err);
	if (!rig)
		cli_fail_with(&err);
	clock = incise_rig_clock(rig);
	plan = incise_plan_new(scene, rig, &err);
	if (!plan)
		cli_fail_with(&err);
	prepare(nonsense);
	take_devices(rig);
	for (int k = 0; k < TICKS; k++, hostile.fails_at--) {
		int rc;

		incise_clock_wait_until(clock, incise_clock_now(clock) + MS);
		rc = incise_plan_tick(plan, incise_clock_now(clock), &tick);
		extremes_check(
			row, is_right(plan, rc, failed, &tick),
			"tick %d: %d after %d, force " V3 ", rendered " V3 ", target %a, "
			"flags %#x, fault '%s'; failure %d with %d and faults %#x, of %s",
			k, rc, failed, V3_OF(tick.command_N), V3_OF(tick.rendered_N),
			hostile.target_mm, tick.flags, incise_plan_fault(plan) ?: "",
			hostile.what, hostile.rc, hostile.faults, spec);
		failed = rc;
	}
	give_back_devices(rig);
	incise_plan_free(plan);
	incise_rig_close(rig);
}

static void try_devices(struct extremes_row *row, const struct property *property)
{
	struct memory_file file = memory_file_begin("scene");
	struct incise_error err = {0};
	struct incise_scene *scene;

	fputs("tissue = { reaction_N_mm = 0.3; plane_N_mm = 0.05; };\n"
	      "device = { delay_ticks = 12; };\n"
	      "limits = { ramp_ms = 10.0; };\n",
	      file.file);
	memory_file_written(&file);
	scene = incise_scene_load(file.path, NULL, &err);
	if (!scene)
		cli_fail_with(&err);
	/* Of a part of the cases a third: a run has hundreds of ticks. */
	for (long k = extremes_cases(row,
				     property->cases / (row->setup->part > 1 ? 3 : 1));
	     k; k--)
		run(row, scene, property->kind);
	incise_scene_free(scene);
	fclose(file.file);
}

const struct property device_properties[] = {
	{"device_fault",
	 "a tracker or one of one to three actuators of the virtual rig fails, or latches a "
	 "fault, at any tick of a cut: that tick and all after it tell it with its reason, and ask for "
	 "no force",
	 RUNS, .all = try_devices, .kind = false},
	{"device_nonsense",
	 "all of them tell numbers that cannot be: forces within the limit, and targets within "
	 "the travel",
	 RUNS, .all = try_devices, .kind = true},
	{0},
};
