// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The self-test of a scene; see haptic.h.
 */
#include <errno.h>
#include <math.h>
#include "../../lib/base/vector.h"
#include "../plan/stroke.h"
#include "haptic.h"

#define STROKE_S 0.6
#define ABOVE_NS 20000000 /* so long it is 4 mm above or more */

/* A plan that is fed with the poses of a stroke. */
struct trajectory {
	struct incise_plan *plan;
	struct stroke stroke;
	struct incise_tracker_sample sample;
	int64_t pose, period_ns, t_ns, last_pose_ns;
	double force_N;
};

static int run_tick(struct trajectory *trajectory, bool fed, struct self_test *test,
		    struct incise_error *err)
{
	struct incise_tick tick;
	int rc;

	trajectory->t_ns += trajectory->period_ns;
	while (fed && trajectory->sample.t_ns <= trajectory->t_ns) {
		incise_plan_feed(trajectory->plan, &trajectory->sample, 1);
		trajectory->last_pose_ns =
			trajectory->sample.t_ns - trajectory->stroke.tracker->latency_ns;
		stroke_pose(&trajectory->stroke, ++trajectory->pose, &trajectory->sample);
	}
	rc = incise_plan_tick(trajectory->plan, trajectory->t_ns, &tick);
	if (rc)
		return incise_error_set(err, -rc,
					"self-test: a tick failed without devices");
	trajectory->force_N = v3_length(tick.command_N);
	if (tick.flags & INCISE_TICK_NOT_FINITE || !isfinite(trajectory->force_N))
		return incise_error_set(
			err, EPROTO,
			"self-test: at a depth of %g mm and %g mm/s the force is not a "
			"number; check the scene's model with incise eval",
			tick.depth_mm, tick.velocity_mm_s);
	if (trajectory->t_ns < ABOVE_NS &&
	    (tick.flags & INCISE_TICK_CONTACT || trajectory->force_N > 0))
		return incise_error_set(
			err, EPROTO,
			"self-test: contact and a force of %g N 4 mm above the surface; "
			"check whether its outside is inside",
			trajectory->force_N);
	test->contact += !!(tick.flags & INCISE_TICK_CONTACT);
	test->force_max_N = fmax(test->force_max_N, trajectory->force_N);
	return 0;
}

static int run_self_test(struct trajectory *trajectory, double force_N,
			 struct self_test *test, struct incise_error *err)
{
	int64_t end_ns = (int64_t)(STROKE_S * INCISE_NS_PER_S), most_ns;
	int rc = 0;

	while (!rc && trajectory->t_ns < end_ns)
		rc = run_tick(trajectory, true, test, err);
	if (rc)
		return rc;
	if (!test->contact)
		return incise_error_set(
			err, EPROTO,
			"self-test: a stroke over the surface at (%g, %g, %g) mm met no "
			"tissue; check its size and place, which must be within 10 m of "
			"the tracker's origin",
			trajectory->stroke.top.point_mm[0],
			trajectory->stroke.top.point_mm[1],
			trajectory->stroke.top.point_mm[2]);
	if (test->force_max_N > force_N)
		return incise_error_set(
			err, EPROTO, "self-test: a force of %g N, above limits.force_N",
			test->force_max_N);
	most_ns = (int64_t)(test->silent_max_ms * 1e6);
	while (!rc && trajectory->force_N > 0 &&
	       trajectory->t_ns - trajectory->last_pose_ns <= most_ns)
		rc = run_tick(trajectory, false, test, err);
	test->silent_ms = (double)(trajectory->t_ns - trajectory->last_pose_ns) * 1e-6;
	if (!rc && trajectory->force_N > 0)
		return incise_error_set(
			err, EPROTO,
			"self-test: %g ms after the last pose there is still "
			"a force of %g N",
			test->silent_ms, trajectory->force_N);
	return rc;
}

int haptic_self_test(const struct incise_scene *scene, struct incise_tracker *tracker,
		     struct self_test *test, struct incise_error *err)
{
	struct incise_scene_limits limits;
	struct incise_tracker_info info;
	struct trajectory trajectory = {0};
	struct incise_error why = {0};
	int rc;

	*test = (struct self_test){0};
	incise_tracker_info(tracker, &info);
	trajectory.plan = incise_plan_new_fed(scene, &info, err);
	if (!trajectory.plan)
		return -errno;
	trajectory.period_ns = llrint(INCISE_NS_PER_S / incise_scene_rate_hz(scene));
	stroke_begin(&trajectory.stroke, trajectory.plan, &info);
	stroke_pose(&trajectory.stroke, 0, &trajectory.sample);
	incise_scene_limits(scene, &limits);
	/* A tick sees the age, and the tick after it the first of the fade. */
	test->silent_max_ms = limits.pose_age_ms +
			      (double)incise_plan_fade_ns(trajectory.plan) * 1e-6 +
			      2e-6 * (double)trajectory.period_ns;
	rc = run_self_test(&trajectory, limits.force_N, test, &why);
	incise_plan_free(trajectory.plan);
	return rc ? incise_error_set(err, -rc, "%s: %s", incise_scene_file(scene, 0),
				     why.text)
		  : 0;
}
