// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A trajectory, and plans on their way along it; see trajectory.h.
 */
#include <math.h>
#include "../../lib/base/vector.h"
#include "../cli/cli.h"
#include "../plan/stroke.h"
#include "trajectory.h"

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

/* Whether a pose of a stroke does not come. */
static bool lost(int stroke, double t_s)
{
	return stroke % GAP_EVERY == GAP_EVERY - 1 && t_s >= GAP_FROM_S && t_s < GAP_TO_S;
}

/* The scalpel is turned round, with its handle's end where the tip was. */
static void turn_round(struct incise_tracker_sample *sample,
		       const struct incise_scene_scalpel *scalpel)
{
	const double *side = scalpel->side,
		     q[4] = {sample->quaternion[0], sample->quaternion[1],
			     sample->quaternion[2], sample->quaternion[3]};
	double along[3];

	/* The product of q and a half turn about the side. */
	v3_cross(sample->quaternion + 1, q + 1, side);
	v3_add(sample->quaternion + 1, sample->quaternion + 1, q[0], side);
	sample->quaternion[0] = -v3_dot(q + 1, side);
	v3_rotate(along, sample->quaternion, scalpel->axis);
	v3_add(sample->position_mm, sample->position_mm, -scalpel->handle_mm, along);
}

static void vary(struct incise_tracker_sample *sample, const struct stroke *stroke,
		 int number, double t_s)
{
	double deeper =
		DEEPER_MM * (number % DEPTHS) * pow(sin(M_PI * t_s / STROKE_S), 2);
	double half = TURN_RAD * number / 2;

	v3_add(sample->position_mm, sample->position_mm, -deeper, stroke->top.normal);
	sample->quaternion[0] = cos(half);
	sample->quaternion[1 + number / 3 % 3] = sin(half);
}

void trajectory_make(struct trajectory *trajectory, const struct incise_scene *scene,
		     const struct incise_plan *plan, int strokes, bool inserts,
		     bool varied)
{
	struct incise_scene_scalpel scalpel;
	struct stroke stroke;
	int each;

	*trajectory = (struct trajectory){
		.tracker = {.name = "usual", .rate_hz = 120, .latency_ns = 4200000},
		.strokes = strokes,
		.period_ns = llrint(1e9 / incise_scene_rate_hz(scene)),
	};
	trajectory->stroke_ns = llrint(STROKE_S / NS / (double)trajectory->period_ns) *
				trajectory->period_ns;
	trajectory->ticks =
		(int)(trajectory->stroke_ns / trajectory->period_ns) * strokes;
	each = (int)(STROKE_S * trajectory->tracker.rate_hz);
	trajectory->poses = cli_alloc((size_t)each * strokes, sizeof(*trajectory->poses));
	incise_scene_scalpel(scene, &scalpel);
	stroke_begin(&stroke, plan, &trajectory->tracker);
	for (int i = 0; i < each * strokes; i++) {
		struct incise_tracker_sample *sample =
			&trajectory->poses[trajectory->n_poses];
		double t_s = i % each / trajectory->tracker.rate_hz;

		stroke_pose(&stroke, i % each, sample);
		sample->t_ns += i / each * trajectory->stroke_ns;
		sample->seq = i;
		if (varied)
			vary(sample, &stroke, i / each, t_s);
		if (inserts && tools[i / each % 3] == INCISE_TOOL_HANDLE)
			turn_round(sample, &scalpel);
		if (!varied || !lost(i / each, t_s))
			trajectory->n_poses++;
	}
}

int64_t walk_feed(struct walk *walk)
{
	const struct trajectory *trajectory = walk->trajectory;
	int64_t t_ns;

	if (walk->tick == trajectory->ticks) {
		walk->begin_ns += trajectory->strokes * trajectory->stroke_ns;
		walk->tick = walk->pose = 0;
	}
	t_ns = walk->tick * trajectory->period_ns;
	if (!(t_ns % trajectory->stroke_ns))
		incise_plan_set_tool(walk->plan, tools[t_ns / trajectory->stroke_ns % 3]);
	while (walk->pose < trajectory->n_poses &&
	       trajectory->poses[walk->pose].t_ns <= t_ns) {
		struct incise_tracker_sample sample = trajectory->poses[walk->pose++];

		sample.t_ns += walk->begin_ns;
		incise_plan_feed(walk->plan, &sample, 1);
	}
	walk->tick++;
	return walk->begin_ns + t_ns;
}

void walk_change(struct walk *walk, const struct trajectory *trajectory)
{
	walk->begin_ns += walk->tick * walk->trajectory->period_ns;
	walk->trajectory = trajectory;
	walk->tick = walk->pose = 0;
}

void walk_run(void *context)
{
	struct walk *walk = context;
	struct incise_tick tick;

	for (int i = 0; i < walk->trajectory->ticks; i++)
		incise_plan_tick(walk->plan, walk_feed(walk), &tick);
}
