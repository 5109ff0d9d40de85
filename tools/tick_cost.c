// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a tick costs; see tick_cost.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "stopwatch.h"
#include "tick_cost.h"

#define NS 1e-9
#define ABOVE_MM 5.0
#define DEPTH_MM 1.0
#define DOWN_S 0.2
#define REACH_MM 5.0
#define STROKE_HZ 1.27 /* 5 mm · 2π · 1.27 Hz = 40 mm/s */

static const struct incise_tracker_info usual_tracker = {
	.name = "usual",
	.rate_hz = 120,
	.latency_ns = 4200000,
};

struct stroke {
	const struct incise_tracker_info *tracker;
	struct incise_touch top;
	double along[3]; /* in the surface */
};

static void stroke_begin(struct stroke *stroke, const struct incise_plan *plan)
{
	const double *n = stroke->top.normal;
	double size;

	incise_plan_top(plan, &stroke->top);
	/* Across the normal, in the plane of its largest part and the next axis. */
	memset(stroke->along, 0, sizeof(stroke->along));
	for (int i = 0; i < 3; i++)
		if (fabs(n[i]) >= fabs(n[(i + 1) % 3]) &&
		    fabs(n[i]) >= fabs(n[(i + 2) % 3])) {
			size = hypot(n[i], n[(i + 1) % 3]);
			stroke->along[(i + 1) % 3] = n[i] / size;
			stroke->along[i] = -n[(i + 1) % 3] / size;
			break;
		}
}

static void stroke_pose(const struct stroke *stroke, int64_t pose,
			struct incise_tracker_sample *sample)
{
	double t = (double)pose / stroke->tracker->rate_hz, down = fmin(t / DOWN_S, 1);
	double above = ABOVE_MM - (ABOVE_MM + DEPTH_MM) * down;
	double off = REACH_MM * sin(2 * M_PI * STROKE_HZ * t);

	*sample = (struct incise_tracker_sample){
		.t_ns = llrint(t / NS) + stroke->tracker->latency_ns,
		.quaternion = {1},
		.status = ' ',
	};
	for (int i = 0; i < 3; i++)
		sample->position_mm[i] = stroke->top.point_mm[i] +
					 above * stroke->top.normal[i] +
					 off * stroke->along[i];
}

/* What reading the clock twice adds to a time, ns. */
static double clock_cost(void)
{
	static double times[10001];
	const int n = sizeof(times) / sizeof(*times);

	for (int i = 0; i < n; i++) {
		times[i] = stopwatch_ns();
		times[i] = stopwatch_ns() - times[i];
	}
	stopwatch_sort(times, n);
	return stopwatch_middle(times, n);
}

/*
 * Run the stroke. With @stage_ns, room for @ticks times of each stage, it is the stages
 * that are timed, else the ticks. Returns how many ticks were in contact.
 */
static int run(const struct incise_scene *scene,
	       const struct incise_tracker_info *tracker, enum incise_tool tool,
	       int ticks, double *tick_ns, double *stage_ns)
{
	int64_t period_ns = llrint(1e9 / incise_scene_rate_hz(scene)), pose = 0, own[16];
	struct incise_error err = {0};
	struct incise_plan *plan = incise_plan_new_fed(scene, tracker, &err);
	struct incise_tracker_sample sample;
	struct stroke stroke = {.tracker = tracker};
	int n = 0;

	_Static_assert(INCISE_PLAN_STAGES_MAX == 16, "room for the stages");
	if (!plan)
		cli_fail_with(&err);
	incise_plan_set_tool(plan, tool);
	stroke_begin(&stroke, plan);
	stroke_pose(&stroke, 0, &sample);
	for (int i = 0; i < ticks; i++) {
		int64_t t_ns = (i + 1) * period_ns;
		struct incise_tick tick;
		double begin, ns;

		while (sample.t_ns <= t_ns) {
			incise_plan_feed(plan, &sample, 1);
			stroke_pose(&stroke, ++pose, &sample);
		}
		if (stage_ns) {
			incise_plan_tick_timed(plan, t_ns, &tick, own);
			ns = 0;
		} else {
			begin = stopwatch_ns();
			incise_plan_tick(plan, t_ns, &tick);
			ns = stopwatch_ns() - begin;
		}
		if (!(tick.flags & INCISE_TICK_CONTACT))
			continue;
		for (int k = 0; stage_ns && incise_plan_stage(plan, k); k++)
			stage_ns[k * ticks + n] = (double)own[k];
		if (tick_ns)
			tick_ns[n] = ns;
		n++;
	}
	incise_plan_free(plan);
	return n;
}

/* The cost with one tool. */
static void cost_with(const struct incise_scene *scene,
		      const struct incise_tracker_info *tracker, enum incise_tool tool,
		      int ticks, double *times, struct tick_cost *cost)
{
	double own = clock_cost();
	int n;

	/* The first run brings code and surface into the caches. */
	run(scene, tracker, tool, ticks / 4, times, NULL);
	n = cost->ticks = run(scene, tracker, tool, ticks, times, NULL);
	if (!n) {
		cost->median = cost->p99 = cost->p999 = NAN;
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
			cost->stage[k] = NAN;
		return;
	}
	stopwatch_sort(times, n);
	cost->median = fmax(stopwatch_quantile(times, n, 0.5) - own, 0);
	cost->p99 = fmax(stopwatch_quantile(times, n, 0.99) - own, 0);
	cost->p999 = fmax(stopwatch_quantile(times, n, 0.999) - own, 0);
	n = run(scene, tracker, tool, ticks, NULL, times);
	for (int k = 0; k < INCISE_PLAN_STAGES_MAX && n; k++) {
		double *stage = times + (size_t)k * ticks;

		stopwatch_sort(stage, n);
		cost->stage[k] = fmax(stopwatch_middle(stage, n) - own, 0);
	}
}

void tick_cost(const struct incise_scene *scene,
	       const struct incise_tracker_info *tracker, double seconds,
	       struct tick_cost *cost)
{
	int ticks = (int)fmax(seconds * incise_scene_rate_hz(scene), 1000);
	double *times = calloc((size_t)ticks * INCISE_PLAN_STAGES_MAX, sizeof(*times));
	struct tick_cost blade = {0}, tube = {0};

	if (!times)
		cli_fail("no memory for the times of %d ticks", ticks);
	if (!tracker)
		tracker = &usual_tracker;
	cost_with(scene, tracker, INCISE_TOOL_BLADE, ticks, times, &blade);
	/* In a scene without insertion this is the blade once more. */
	cost_with(scene, tracker, INCISE_TOOL_TUBE, ticks, times, &tube);
	free(times);
	*cost = tube.median > blade.median ? tube : blade;
	for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
		cost->stage[k] = fmax(blade.stage[k], tube.stage[k]);
}
