// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The real-time loop; see incise/loop.h.
 *
 *   due     |      |      |      |      |      |      |
 *   wake    |.     |..    |.....................|.    |
 *   tick    ▐█     ▐█     (late)  skip   skip   ▐█    ▐█
 *             ╰ lateness
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/prctl.h>
#include <incise/loop.h>
#include "../scene/plan.h"
#include "loop_control.h"
#include "state_page.h"

struct loop_run {
	struct incise_plan *plan;
	struct incise_clock *clock;
	const struct incise_loop_options *options;
	struct incise_loop_stats *stats;
	int64_t period_ns, due_ns, end_ns;
	bool fading;
	int64_t fade_end_ns;	    /* latest end of the fade that stops it */
	int64_t lag_ns;		    /* of this tick */
	uint64_t skipped;	    /* before this tick */
	unsigned int in_row;	    /* consecutive overruns */
	unsigned int flags;	    /* of the last tick */
	char pose_flag;		    /* of poses, as last reported */
	enum incise_tool tool;	    /* of the last tick */
	enum incise_haptic_off off; /* as last reported */
	int64_t stale_ns;	    /* time of the first tick without a fresh pose */
};

static void count_loop(uint64_t *histogram, int64_t value)
{
	if (value < 0)
		value = 0;
	histogram[value < INCISE_LOOP_BINS - 1 ? value : INCISE_LOOP_BINS - 1]++;
}

/* Ticks that explain a run without any force. */
static void count_forceless(struct loop_run *run, const struct incise_tick *tick)
{
	const unsigned int blind =
		INCISE_TICK_STALE | INCISE_TICK_UNUSABLE | INCISE_TICK_FAULT;
	struct incise_loop_stats *stats = run->stats;
	struct incise_touch touch;

	if (tick->flags & INCISE_TICK_CONTACT) {
		for (int i = 0; i < INCISE_TICK_FLAGS; i++)
			stats->forceless[i] += tick->flags >> i & 1;
		stats->forceless_off = incise_plan_off(run->plan);
	} else if (!stats->flagged[0] && !(tick->flags & blind)) {
		incise_surface_nearest(incise_plan_surface(run->plan), tick->tool_mm,
				       &touch);
		stats->nearest_mm = fmin(stats->nearest_mm, -touch.depth_mm);
	}
}

static void count_tick(struct loop_run *run, const struct incise_tick *tick)
{
	struct incise_loop_stats *stats = run->stats;
	double force = 0;

	for (int i = 0; i < 3; i++)
		force += tick->command_N[i] * tick->command_N[i];
	for (int i = 0; i < INCISE_RIG_AXES_MAX; i++) {
		double off = tick->rendered_N[i] - stats->actuated_N[i];

		/* A reading in a tick answers the command of the tick before. */
		if (stats->ticks)
			stats->rendered_off2 += off * off;
		stats->actuated_N[i] = tick->actuated_N[i];
	}
	stats->force_N = sqrt(force);
	stats->unfelt2 += tick->unfelt_N * tick->unfelt_N;
	stats->unfelt_max_N = fmax(stats->unfelt_max_N, tick->unfelt_N);
	stats->force_max_N = fmax(stats->force_max_N, stats->force_N);
	if (!(stats->force_N > 0))
		count_forceless(run, tick);
	stats->ticks++;
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		stats->flagged[i] += tick->flags >> i & 1;
	stats->limited += !!(tick->flags & (INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED));
}

static void send_event(const struct loop_run *run, enum incise_loop_event_kind kind,
		       int64_t t_ns, double value)
{
	struct incise_loop_event event = {t_ns, run->stats->ticks, value, kind};

	if (run->options->control)
		incise_loop_control_event(run->options->control, &event);
}

/* Report flags that changed. */
static void report_changes(struct loop_run *run, const struct incise_tick *tick)
{
	unsigned int begun = tick->flags & ~run->flags, ended = run->flags & ~tick->flags;
	char flag = incise_plan_pose_flag(run->plan);

	if (begun & INCISE_TICK_STALE) {
		run->stale_ns = tick->t_ns;
		send_event(run, INCISE_LOOP_STALE, tick->t_ns, 0);
	}
	/* A tick that failed read no pose. */
	if (ended & INCISE_TICK_STALE && !(tick->flags & INCISE_TICK_FAULT))
		send_event(run, INCISE_LOOP_FRESH, tick->t_ns,
			   (double)(tick->t_ns - run->stale_ns) * 1e-6);
	if (begun & INCISE_TICK_NOT_FINITE)
		send_event(run, INCISE_LOOP_NOT_FINITE, tick->t_ns, 0);
	if (flag && flag != ' ' && flag != run->pose_flag) {
		send_event(run, INCISE_LOOP_FLAGGED, tick->t_ns, flag);
		run->pose_flag = flag;
	}
	/* At the first tick nothing has changed. */
	if (tick->tool != run->tool && run->stats->ticks > 1)
		send_event(run, INCISE_LOOP_TOOL, tick->t_ns, tick->tool);
	if (incise_plan_off(run->plan) != run->off) {
		run->off = incise_plan_off(run->plan);
		send_event(run, INCISE_LOOP_HAPTIC, tick->t_ns, run->off);
	}
	run->tool = tick->tool;
	run->flags = tick->flags;
}

/* One tick with its statistics. */
static INCISE_REALTIME int run_tick(struct loop_run *run, struct incise_tick *tick,
				    int64_t start_ns)
{
	const struct incise_loop_options *options = run->options;
	int rc = incise_plan_tick(run->plan, start_ns, tick);
	int64_t cost_ns = incise_clock_now(run->clock) - start_ns;

	if (cost_ns > run->stats->tick_max_ns)
		run->stats->tick_max_ns = cost_ns;
	count_loop(run->stats->tick_100ns, cost_ns / 100);
	count_tick(run, tick);
	report_changes(run, tick);
	incise_state_tick(options->state, tick, run->lag_ns, cost_ns, run->skipped);
	if (options->control)
		incise_loop_control_ticked(options->control, run->stats->ticks,
					   tick->tool);
	return rc;
}

/* A stall past the end skips only the ticks that were still due. */
static INCISE_REALTIME int skip(struct loop_run *run, int64_t now_ns)
{
	int64_t ticks = (now_ns - run->due_ns) / run->period_ns;
	int64_t left = (run->end_ns - run->due_ns - 1) / run->period_ns + 1;

	run->skipped = (uint64_t)(ticks < left ? ticks : left);
	if (!ticks) {
		run->in_row = 0;
		return 0;
	}
	run->stats->skipped += run->skipped;
	run->stats->overruns++;
	run->in_row++;
	send_event(run, INCISE_LOOP_OVERRUN, now_ns, (double)run->skipped);
	run->due_ns += ticks * run->period_ns;
	return run->options->overruns_most && run->in_row >= run->options->overruns_most
		       ? -ETIME
		       : 0;
}

/* Whether the loop ends before the next tick: after its duration, or stopped and faded. */
static INCISE_REALTIME bool stops(struct loop_run *run)
{
	const struct incise_loop_options *options = run->options;

	if (run->due_ns >= run->end_ns)
		return true;
	if (!options->stop || !*options->stop)
		return false;
	if (!run->fading) {
		run->fading = true;
		run->fade_end_ns = run->due_ns + incise_plan_fade_ns(run->plan);
		incise_plan_fade(run->plan, true);
	}
	return incise_plan_faded(run->plan) || run->due_ns > run->fade_end_ns;
}

/* A waiting plan takes over at a tick at which the old one requests no force. */
static INCISE_REALTIME void change_plan(struct loop_run *run, int64_t now_ns)
{
	bool waits = !run->fading && run->options->control &&
		     incise_loop_control_waiting(run->options->control);
	struct incise_pose_counts poses;
	struct incise_plan *next;

	if (run->fading)
		return;
	incise_plan_fade(run->plan, waits);
	if (!waits || !incise_plan_faded(run->plan))
		return;
	next = incise_loop_control_next(run->options->control);
	if (!next)
		return;
	incise_plan_poses(run->plan, &poses);
	incise_pose_counts_add(&run->stats->poses, &poses);
	incise_plan_take_over(next, run->plan);
	incise_loop_control_retire(run->options->control, run->plan);
	run->plan = next;
	send_event(run, INCISE_LOOP_PLAN, now_ns, 0);
}

/* At each tick, as the plan may be another. */
static INCISE_REALTIME void take_tool(struct loop_run *run)
{
	enum incise_tool tool;

	if (run->options->control &&
	    incise_loop_control_wanted_tool(run->options->control, &tool))
		incise_plan_set_tool(run->plan, tool);
}

static INCISE_REALTIME void count_lateness(struct loop_run *run, int64_t now_ns)
{
	int64_t lag_ns = now_ns - run->due_ns + incise_clock_lag_ns(run->clock);

	run->lag_ns = lag_ns;
	if (lag_ns > run->stats->lateness_max_ns)
		run->stats->lateness_max_ns = lag_ns;
	count_loop(run->stats->lateness_us, lag_ns / 1000);
}

/* Returns 0 or a device's errno; *ended is the result of options->ticked(). */
static int run_ticks(struct loop_run *run, int *ended)
{
	const struct incise_loop_options *options = run->options;
	struct incise_loop_stats *stats = run->stats;
	int rc = 0;

	while (!rc && !*ended && !stops(run)) {
		struct incise_tick own, *tick = &own;
		int64_t now_ns;

		if (incise_clock_wait_until(run->clock, run->due_ns) == -EINTR)
			continue;
		now_ns = incise_clock_now(run->clock);
		count_lateness(run, now_ns);
		rc = skip(run, now_ns);
		if (rc || run->due_ns >= run->end_ns)
			break;
		change_plan(run, now_ns);
		take_tool(run);
		if (stats->logged < options->log_size)
			tick = &options->log[stats->logged++];
		rc = run_tick(run, tick, now_ns);
		run->due_ns += run->period_ns;
		if (!rc && options->control)
			incise_loop_control_tick(options->control, tick);
		if (!rc && options->ticked)
			*ended = options->ticked(options->context, tick);
	}
	return rc;
}

static int explain(const struct loop_run *run, int rc, struct incise_error *err)
{
	unsigned long long ticks = run->stats->ticks;
	char cause[300];

	if (rc == -ETIME)
		return incise_error_set(
			err, ETIME,
			"%u ticks in a row were a period late or more, the last at "
			"tick %llu: the force was removed; this machine is too slow or "
			"too busy for %g Hz",
			run->in_row, ticks, run->options->rate_hz);
	incise_plan_cause(run->plan, cause, sizeof(cause));
	return incise_error_set(err, -rc,
				"a device failed at tick %llu: %s; the force was removed",
				ticks, cause);
}

int incise_loop_run(struct incise_plan *plan, struct incise_clock *clock,
		    const struct incise_loop_options *options,
		    struct incise_loop_stats *stats, struct incise_error *err)
{
	struct incise_pose_counts poses;
	struct loop_run run = {
		.plan = plan, .clock = clock, .options = options, .stats = stats};
	int rc, released, slack_ns, ended = 0;

	memset(stats, 0, sizeof(*stats));
	stats->nearest_mm = HUGE_VAL;
	if (options->duration_ns < 0)
		return incise_error_set(err, EINVAL, "the loop's duration is negative");
	if (!(options->rate_hz >= 1 && options->rate_hz <= 20000))
		return incise_error_set(err, EINVAL,
					"the loop's rate is %g Hz: expected 1 to 20000",
					options->rate_hz);
	/* Without a real-time policy the kernel wakes a thread up to 50 us late by default. */
	slack_ns = prctl(PR_GET_TIMERSLACK);
	prctl(PR_SET_TIMERSLACK, 1);
	run.period_ns = llrint(INCISE_NS_PER_S / options->rate_hz);
	run.due_ns = incise_clock_now(clock) + run.period_ns;
	run.end_ns = options->duration_ns ? run.due_ns + options->duration_ns : INT64_MAX;
	rc = run_ticks(&run, &ended);
	if (slack_ns > 0)
		prctl(PR_SET_TIMERSLACK, slack_ns);
	incise_plan_poses(run.plan, &poses);
	incise_pose_counts_add(&stats->poses, &poses);
	stats->texture_felt = incise_plan_texture_felt(run.plan);
	released = incise_plan_release(run.plan);
	if (!rc && !ended)
		rc = released;
	return rc ? explain(&run, rc, err) : ended;
}

double incise_loop_quantile(const uint64_t *histogram, double share)
{
	uint64_t total = 0, seen = 0;

	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		total += histogram[i];
	if (!total)
		return 0;
	for (int i = 0; i < INCISE_LOOP_BINS; i++) {
		seen += histogram[i];
		if (seen >= share * total)
			return i + 1;
	}
	return INCISE_LOOP_BINS;
}
