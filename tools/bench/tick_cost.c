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

/* The way of each cut: above its place, down, along, up. */
#define CUT_S 0.8
#define CUT_MM 10.0
#define CUT_DEPTH_MM 2.0
#define CUT_APART_MM 2.5
#define CUT_ABOVE_MM 4.0

static void cut_pose(const struct stroke *stroke, int cut, int cuts, double t_s,
		     double position_mm[3])
{
	const double *n = stroke->top.normal, *along = stroke->along;
	double phase = 4 * t_s / CUT_S, out_mm, along_mm, aside_mm;

	out_mm = phase < 1   ? CUT_ABOVE_MM
		 : phase < 2 ? CUT_ABOVE_MM - (phase - 1) * (CUT_ABOVE_MM + CUT_DEPTH_MM)
		 : phase < 3 ? -CUT_DEPTH_MM
			     : (phase - 3) * (CUT_ABOVE_MM + CUT_DEPTH_MM) - CUT_DEPTH_MM;
	along_mm = (fmin(fmax(phase - 2, 0), 1) - 0.5) * CUT_MM;
	aside_mm = (cut - (cuts - 1) / 2.0) * CUT_APART_MM;
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		position_mm[i] = stroke->top.point_mm[i] + out_mm * n[i] +
				 along_mm * along[i] +
				 aside_mm * (n[j] * along[k] - n[k] * along[j]);
	}
}

/* The blade makes cuts next to each other. */
static void make_cuts(struct tick_stroke *timed, int cuts)
{
	double pose_s = 1 / incise_tracker_station_hz(timed->tracker), next_s = 0;
	struct incise_tracker_sample sample = {.quaternion = {1}, .status = ' '};
	struct incise_tick tick;

	incise_plan_set_tool(timed->plan, INCISE_TOOL_BLADE);
	while ((double)timed->t_ns * 1e-9 < cuts * CUT_S) {
		timed->t_ns += timed->period_ns;
		for (; next_s <= (double)timed->t_ns * 1e-9; next_s += pose_s) {
			sample.t_ns = timed->t_ns;
			cut_pose(&timed->stroke, (int)(next_s / CUT_S), cuts,
				 fmod(next_s, CUT_S), sample.position_mm);
			incise_plan_feed(timed->plan, &sample, 1);
		}
		incise_plan_tick(timed->plan, timed->t_ns, &tick);
	}
}

struct tick_stroke *tick_stroke_new(const struct incise_scene *scene,
				    struct incise_plan *plan,
				    const struct incise_tracker_info *tracker,
				    enum incise_tool tool, int cuts)
{
	struct tick_stroke *timed = calloc(1, sizeof(*timed));
	struct incise_error err = {0};

	if (!timed)
		cli_fail("no memory");
	timed->tracker = tracker ? tracker : &usual_tracker;
	timed->period_ns = llrint(1e9 / incise_scene_rate_hz(scene));
	timed->clock_ns = stopwatch_own_ns();
	timed->given = plan;
	timed->plan = plan ? plan : incise_plan_new_fed(scene, timed->tracker, &err);
	if (!timed->plan)
		cli_fail_with(&err);
	stroke_begin(&timed->stroke, timed->plan, timed->tracker);
	if (cuts)
		make_cuts(timed, cuts);
	incise_plan_set_tool(timed->plan, tool);
	timed->pose = (int64_t)((double)timed->t_ns * 1e-9 *
				incise_tracker_station_hz(timed->tracker));
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
		      int cuts, int ticks, double *times, struct tick_cost *cost)
{
	struct tick_stroke *timed = tick_stroke_new(scene, plan, tracker, tool, cuts);
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
	       const struct incise_tracker_info *tracker, int cuts, double seconds,
	       struct tick_cost *cost)
{
	int ticks = (int)fmax(seconds * incise_scene_rate_hz(scene), 1000);
	double *times = calloc((size_t)ticks * INCISE_PLAN_STAGES_MAX, sizeof(*times));
	struct tick_cost tube = {0};

	if (!times)
		cli_fail("out of memory for the times of %d ticks", ticks);
	*cost = (struct tick_cost){0};
	if (cost_with(scene, plan, tracker, INCISE_TOOL_BLADE, cuts, ticks, times,
		      cost)) {
		struct tick_cost blade = *cost;

		cost_with(scene, NULL, tracker, INCISE_TOOL_TUBE, cuts, ticks, times,
			  &tube);
		if (tube.median > blade.median)
			*cost = tube;
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++)
			cost->stage[k] = fmax(blade.stage[k], tube.stage[k]);
	}
	free(times);
}
