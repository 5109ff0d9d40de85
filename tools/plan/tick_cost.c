// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The cost of a tick; see tick_cost.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/stopwatch.h"
#include "stroke.h"
#include "tick_cost.h"

static const struct incise_tracker_info usual_tracker = {
	.name = "usual",
	.rate_hz = 120,
	.latency_ns = 4200000,
};

struct tick_stroke {
	struct incise_plan *plan, *given; /* or NULL: its own */
	const struct incise_tracker_info *tracker;
	struct stroke stroke;
	struct incise_tracker_sample sample; /* the next one */
	int64_t period_ns, t_ns, pose;
	double clock_ns;
};

struct tick_stroke *tick_stroke_new(const struct incise_scene *scene,
				    struct incise_plan *plan,
				    const struct incise_tracker_info *tracker,
				    enum incise_tool tool)
{
	struct tick_stroke *timed = calloc(1, sizeof(*timed));
	struct incise_error err = {0};

	if (!timed)
		cli_fail("no memory");
	timed->tracker = tracker ? tracker : &usual_tracker;
	timed->period_ns = llrint(1e9 / incise_scene_rate_hz(scene));
	timed->clock_ns = stopwatch_own_ns();
	timed->given = plan;
	timed->plan = cli_require(
		plan ? plan : incise_plan_new_fed(scene, timed->tracker, &err), &err);
	stroke_begin(&timed->stroke, timed->plan, timed->tracker);
	incise_plan_set_tool(timed->plan, tool);
	stroke_pose(&timed->stroke, timed->pose, &timed->sample);
	return timed;
}

void tick_stroke_free(struct tick_stroke *timed)
{
	if (!timed->given)
		incise_plan_free(timed->plan);
	free(timed);
}

/*
 * Go on with the stroke. With @stage_ns, an array of @ticks times for each stage, it is the
 * stages that are timed, else the ticks. Returns how many ticks were in contact.
 */
static int go_on(struct tick_stroke *c, int ticks, double *tick_ns, double *stage_ns)
{
	int64_t own[INCISE_PLAN_STAGES_MAX];
	int n = 0;

	for (int i = 0; i < ticks; i++) {
		struct incise_tick tick;
		double begin, ns;

		c->t_ns += c->period_ns;
		while (c->sample.t_ns <= c->t_ns) {
			incise_plan_feed(c->plan, &c->sample, 1);
			stroke_pose(&c->stroke, ++c->pose, &c->sample);
		}
		if (stage_ns) {
			incise_plan_tick_timed(c->plan, c->t_ns, &tick, own);
			ns = 0;
		} else {
			begin = stopwatch_ns();
			incise_plan_tick(c->plan, c->t_ns, &tick);
			ns = stopwatch_ns() - begin;
		}
		if (!(tick.flags & INCISE_TICK_CONTACT))
			continue;
		for (int k = 0; stage_ns && incise_plan_stage(c->plan, k); k++)
			stage_ns[k * ticks + n] = (double)own[k];
		if (tick_ns)
			tick_ns[n] = ns;
		n++;
	}
	return n;
}

double tick_stroke_ns(struct tick_stroke *timed, int ticks, double *ns)
{
	int n = go_on(timed, ticks, ns, NULL);

	if (!n)
		return NAN;
	stopwatch_sort(ns, n);
	return fmax(stopwatch_middle(ns, n) - timed->clock_ns, 0);
}

static bool has_insertion(const struct incise_plan *plan)
{
	for (int k = 0; incise_plan_stage(plan, k); k++)
		if (!strcmp(incise_plan_stage(plan, k), "insertion"))
			return true;
	return false;
}

/* The cost with one tool. Returns whether there is another one. */
static bool cost_with(const struct incise_scene *scene, struct incise_plan *plan,
		      const struct incise_tracker_info *tracker, enum incise_tool tool,
		      int ticks, double *times, struct tick_cost *cost)
{
	struct tick_stroke *timed = tick_stroke_new(scene, plan, tracker, tool);
	bool insertion = has_insertion(timed->plan);
	double own = timed->clock_ns;
	int n;

	cost->tool = tool;
	/* The first part brings code and surface into the caches. */
	go_on(timed, ticks / 4, times, NULL);
	n = cost->ticks = go_on(timed, ticks, times, NULL);
	if (!n) {
		cost->median = cost->p99 = cost->p999 = NAN;
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
			cost->stage[k] = NAN;
		tick_stroke_free(timed);
		return insertion;
	}
	stopwatch_sort(times, n);
	cost->median = fmax(stopwatch_quantile(times, n, 0.5) - own, 0);
	cost->p99 = fmax(stopwatch_quantile(times, n, 0.99) - own, 0);
	cost->p999 = fmax(stopwatch_quantile(times, n, 0.999) - own, 0);
	n = go_on(timed, ticks, NULL, times);
	for (int k = 0; k < INCISE_PLAN_STAGES_MAX && n; k++) {
		double *stage = times + (size_t)k * ticks;

		stopwatch_sort(stage, n);
		cost->stage[k] = fmax(stopwatch_middle(stage, n) - own, 0);
	}
	tick_stroke_free(timed);
	return insertion;
}

void tick_cost(const struct incise_scene *scene, struct incise_plan *plan,
	       const struct incise_tracker_info *tracker, double seconds,
	       struct tick_cost *cost)
{
	int ticks = (int)fmax(seconds * incise_scene_rate_hz(scene), 1000);
	double *times = calloc((size_t)ticks * INCISE_PLAN_STAGES_MAX, sizeof(*times));
	struct tick_cost tube = {0};

	if (!times)
		cli_fail("out of memory for the times of %d ticks", ticks);
	*cost = (struct tick_cost){0};
	if (cost_with(scene, plan, tracker, INCISE_TOOL_BLADE, ticks, times, cost)) {
		struct tick_cost blade = *cost;

		cost_with(scene, NULL, tracker, INCISE_TOOL_TUBE, ticks, times, &tube);
		if (tube.median > blade.median)
			*cost = tube;
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
			cost->stage[k] = fmax(blade.stage[k], tube.stage[k]);
	}
	free(times);
}
