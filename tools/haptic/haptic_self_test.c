// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a scene does before anything moves; see haptic_self_test.h.
 */
#include <errno.h>
#include <math.h>
#include "haptic_self_test.h"
#include "../cli/stroke.h"

#define STROKE_S 0.6

static double size(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Ticks of a plan until a time; poses come until another. */
struct course {
	struct incise_plan *plan;
	struct stroke stroke;
	struct incise_tracker_sample sample;
	int64_t pose, period_ns, t_ns, last_pose_ns;
	double force_N;
};

static int run_tick(struct course *course, bool fed, struct self_test *test,
		    struct incise_error *err)
{
	struct incise_tick tick;
	int rc;

	course->t_ns += course->period_ns;
	while (fed && course->sample.t_ns <= course->t_ns) {
		incise_plan_feed(course->plan, &course->sample, 1);
		course->last_pose_ns =
			course->sample.t_ns - course->stroke.tracker->latency_ns;
		stroke_pose(&course->stroke, ++course->pose, &course->sample);
	}
	rc = incise_plan_tick(course->plan, course->t_ns, &tick);
	if (rc)
		return incise_error_set(err, -rc,
					"self-test: a tick failed without devices");
	course->force_N = size(tick.command_N);
	if (tick.flags & INCISE_TICK_NOT_FINITE || !isfinite(course->force_N))
		return incise_error_set(
			err, EPROTO,
			"self-test: %g mm deep at %g mm/s the force is no number; see the "
			"scene's model",
			tick.depth_mm, tick.velocity_mm_s);
	test->contact += !!(tick.flags & INCISE_TICK_CONTACT);
	test->force_max_N = fmax(test->force_max_N, course->force_N);
	return 0;
}

static int run(struct course *course, double force_N, struct self_test *test,
	       struct incise_error *err)
{
	int64_t end_ns = (int64_t)(STROKE_S * INCISE_NS_PER_S), most_ns;
	int rc = 0;

	while (!rc && course->t_ns < end_ns)
		rc = run_tick(course, true, test, err);
	if (rc)
		return rc;
	if (!test->contact)
		return incise_error_set(err, EPROTO,
					"self-test: a stroke over the scene's top met no "
					"tissue; see its surface");
	if (test->force_max_N > force_N)
		return incise_error_set(
			err, EPROTO, "self-test: a force of %g N, above limits.force_N",
			test->force_max_N);
	most_ns = (int64_t)(test->silent_max_ms * 1e6);
	while (!rc && course->force_N > 0 &&
	       course->t_ns - course->last_pose_ns <= most_ns)
		rc = run_tick(course, false, test, err);
	test->silent_ms = (double)(course->t_ns - course->last_pose_ns) * 1e-6;
	if (!rc && course->force_N > 0)
		return incise_error_set(
			err, EPROTO,
			"self-test: %g ms after the last pose there is still "
			"a force of %g N",
			test->silent_ms, course->force_N);
	return rc;
}

int haptic_self_test(const struct incise_scene *scene, struct incise_tracker *tracker,
		     struct self_test *test, struct incise_error *err)
{
	struct incise_scene_limits limits;
	struct incise_tracker_info info;
	struct course course = {0};
	int rc;

	*test = (struct self_test){0};
	incise_tracker_info(tracker, &info);
	course.plan = incise_plan_new_fed(scene, &info, err);
	if (!course.plan)
		return -errno;
	course.period_ns = llrint(INCISE_NS_PER_S / incise_scene_rate_hz(scene));
	stroke_begin(&course.stroke, course.plan, &info);
	stroke_pose(&course.stroke, 0, &course.sample);
	incise_scene_limits(scene, &limits);
	/* A tick sees the age, and the one after it the first of the fade. */
	test->silent_max_ms = limits.pose_age_ms +
			      (double)incise_plan_fade_ns(course.plan) * 1e-6 +
			      2e-6 * (double)course.period_ns;
	rc = run(&course, limits.force_N, test, err);
	incise_plan_free(course.plan);
	return rc;
}
