// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Strokes that several plans go along; see course.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "course.h"
#include "../cli/stroke.h"

#define NS 1e-9
#define STROKE_S 1.0
#define DEEPER_MM 3.0  /* each stroke than the one before … */
#define DEPTHS 11      /* … up to 30 mm, and then from 0 again */
#define TURN_RAD 0.7   /* each stroke from the one before */
#define GAP_EVERY 5    /* strokes */
#define GAP_FROM_S 0.5 /* of the stroke: without poses for longer than any limit */
#define GAP_TO_S 0.7

static const enum incise_tool tools[] = {INCISE_TOOL_BLADE, INCISE_TOOL_HANDLE,
					 INCISE_TOOL_TUBE};

/* Which of the poses of a stroke do not come. */
static bool lost(int stroke, double t_s)
{
	return stroke % GAP_EVERY == GAP_EVERY - 1 && t_s >= GAP_FROM_S && t_s < GAP_TO_S;
}

static void product(const double a[4], const double b[4], double q[4])
{
	q[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		q[1 + i] = a[0] * b[1 + i] + b[0] * a[1 + i] + a[1 + j] * b[1 + k] -
			   a[1 + k] * b[1 + j];
	}
}

static void rotate(const double q[4], const double v[3], double turned[3])
{
	const double back[4] = {q[0], -q[1], -q[2], -q[3]};
	const double pure[4] = {0, v[0], v[1], v[2]};
	double half[4], whole[4];

	product(q, pure, half);
	product(half, back, whole);
	for (int i = 0; i < 3; i++)
		turned[i] = whole[1 + i];
}

/* The scalpel is turned round, with its handle's end where the tip was. */
static void turn_round(struct incise_tracker_sample *sample,
		       const struct incise_scene_scalpel *scalpel)
{
	const double round[4] = {0, scalpel->side[0], scalpel->side[1], scalpel->side[2]};
	double q[4], along[3];

	product(sample->quaternion, round, q);
	rotate(q, scalpel->axis, along);
	for (int i = 0; i < 4; i++)
		sample->quaternion[i] = q[i];
	for (int i = 0; i < 3; i++)
		sample->position_mm[i] -= scalpel->handle_mm * along[i];
}

static void vary(struct incise_tracker_sample *sample, const struct stroke *stroke,
		 int number, double t_s)
{
	double deeper =
		DEEPER_MM * (number % DEPTHS) * pow(sin(M_PI * t_s / STROKE_S), 2);
	double half = TURN_RAD * number / 2;

	for (int i = 0; i < 3; i++)
		sample->position_mm[i] -= deeper * stroke->top.normal[i];
	sample->quaternion[0] = cos(half);
	sample->quaternion[1 + number / 3 % 3] = sin(half);
}

void course_begin(struct course *course, const struct incise_scene *scene,
		  const struct incise_plan *plan, int strokes, bool inserts, bool varied)
{
	struct incise_scene_scalpel scalpel;
	struct stroke stroke;
	int each;

	*course = (struct course){
		.tracker = {.name = "usual", .rate_hz = 120, .latency_ns = 4200000},
		.strokes = strokes,
		.period_ns = llrint(1e9 / incise_scene_rate_hz(scene)),
	};
	course->stroke_ns =
		llrint(STROKE_S / NS / (double)course->period_ns) * course->period_ns;
	course->ticks = (int)(course->stroke_ns / course->period_ns) * strokes;
	each = (int)(STROKE_S * course->tracker.rate_hz);
	course->poses = calloc((size_t)each * strokes, sizeof(*course->poses));
	if (!course->poses)
		cli_fail("no memory for %d strokes", strokes);
	incise_scene_scalpel(scene, &scalpel);
	stroke_begin(&stroke, plan, &course->tracker);
	for (int i = 0; i < each * strokes; i++) {
		struct incise_tracker_sample *sample = &course->poses[course->n_poses];
		double t_s = i % each / course->tracker.rate_hz;

		stroke_pose(&stroke, i % each, sample);
		sample->t_ns += i / each * course->stroke_ns;
		sample->seq = i;
		if (varied)
			vary(sample, &stroke, i / each, t_s);
		if (inserts && tools[i / each % 3] == INCISE_TOOL_HANDLE)
			turn_round(sample, &scalpel);
		if (!varied || !lost(i / each, t_s))
			course->n_poses++;
	}
}

void course_end(struct course *course)
{
	free(course->poses);
}

int64_t course_feed(struct course_walk *walk)
{
	const struct course *course = walk->course;
	int64_t t_ns;

	if (walk->tick == course->ticks) {
		walk->begin_ns += course->strokes * course->stroke_ns;
		walk->tick = walk->pose = 0;
	}
	t_ns = walk->tick * course->period_ns;
	if (!(t_ns % course->stroke_ns))
		incise_plan_set_tool(walk->plan, tools[t_ns / course->stroke_ns % 3]);
	while (walk->pose < course->n_poses && course->poses[walk->pose].t_ns <= t_ns) {
		struct incise_tracker_sample sample = course->poses[walk->pose++];

		sample.t_ns += walk->begin_ns;
		incise_plan_feed(walk->plan, &sample, 1);
	}
	walk->tick++;
	return walk->begin_ns + t_ns;
}
