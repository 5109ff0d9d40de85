// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a tick costs; see tick_cost.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "stopwatch.h"
#include "stroke.h"
#include "tick_cost.h"

static const struct incise_tracker_info usual_tracker = {
	.name = "usual",
	.rate_hz = 120,
	.latency_ns = 4200000,
};

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
	struct stroke stroke;
	int n = 0;

	_Static_assert(INCISE_PLAN_STAGES_MAX == 16, "room for the stages");
	if (!plan)
		cli_fail_with(&err);
	incise_plan_set_tool(plan, tool);
	stroke_begin(&stroke, plan, tracker);
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
