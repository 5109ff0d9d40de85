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
#include <incise/loop.h>

static void count(uint64_t *histogram, int64_t value)
{
	if (value < 0)
		value = 0;
	histogram[value < INCISE_LOOP_BINS - 1 ? value : INCISE_LOOP_BINS - 1]++;
}

static void count_tick(struct incise_loop_stats *stats, const struct incise_tick *tick)
{
	double force = 0, off = tick->rendered_N - stats->actuated_N;

	for (int i = 0; i < 3; i++)
		force += tick->command_N[i] * tick->command_N[i];
	/* What a tick reads of the actuator answers to the command of the one before. */
	if (stats->ticks)
		stats->rendered_off2 += off * off;
	stats->force_N = sqrt(force);
	stats->actuated_N = tick->actuated_N;
	stats->force_max_N = fmax(stats->force_max_N, stats->force_N);
	stats->ticks++;
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		stats->flagged[i] += tick->flags >> i & 1;
	stats->limited += !!(tick->flags & (INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED));
}

/* One tick with its statistics; start_ns is when it began. */
static int run_tick(struct incise_plan *plan, const struct incise_clock *clock,
		    struct incise_tick *tick, struct incise_loop_stats *stats,
		    int64_t start_ns)
{
	int rc = incise_plan_tick(plan, start_ns, tick);
	int64_t cost_ns = incise_clock_now(clock) - start_ns;

	if (cost_ns > stats->tick_max_ns)
		stats->tick_max_ns = cost_ns;
	count(stats->tick_100ns, cost_ns / 100);
	count_tick(stats, tick);
	return rc;
}

int incise_loop_run(struct incise_plan *plan, struct incise_clock *clock,
		    const struct incise_loop_options *options,
		    struct incise_loop_stats *stats, struct incise_error *err)
{
	int64_t period_ns, due_ns, end_ns;
	int rc = 0, ended = 0;
	char cause[300];

	memset(stats, 0, sizeof(*stats));
	if (options->duration_ns < 0)
		return incise_error_set(err, EINVAL, "the loop's duration is negative");
	if (!(options->rate_hz >= 1 && options->rate_hz <= 20000))
		return incise_error_set(err, EINVAL,
					"the loop's rate is %g Hz: expected 1 to 20000",
					options->rate_hz);
	period_ns = llrint(INCISE_NS_PER_S / options->rate_hz);
	due_ns = incise_clock_now(clock) + period_ns;
	end_ns = options->duration_ns ? due_ns + options->duration_ns : INT64_MAX;
	while (due_ns < end_ns && !ended && !(options->stop && *options->stop)) {
		struct incise_tick own, *tick = &own;
		int64_t now_ns, late_ns, lag_ns;

		if (incise_clock_wait_until(clock, due_ns) == -EINTR)
			continue;
		now_ns = incise_clock_now(clock);
		late_ns = now_ns - due_ns;
		lag_ns = late_ns + incise_clock_lag_ns(clock);
		if (lag_ns > stats->lateness_max_ns)
			stats->lateness_max_ns = lag_ns;
		count(stats->lateness_us, lag_ns / 1000);
		if (late_ns >= period_ns) {
			int64_t skip = late_ns / period_ns;
			int64_t left = (end_ns - due_ns - 1) / period_ns + 1;

			/* A stall over the end leaves out what was still due, and no more. */
			stats->skipped += skip < left ? skip : left;
			if (skip >= left)
				break;
			due_ns += skip * period_ns;
		}
		if (stats->logged < options->log_size)
			tick = &options->log[stats->logged++];
		rc = run_tick(plan, clock, tick, stats, now_ns);
		if (rc)
			break;
		due_ns += period_ns;
		if (options->ticked)
			ended = options->ticked(options->context, tick);
	}
	incise_plan_release(plan);
	if (rc) {
		incise_plan_cause(plan, cause, sizeof(cause));
		incise_error_set(
			err, -rc,
			"a device failed at tick %llu: %s; the force was taken away",
			(unsigned long long)stats->ticks, cause);
	}
	return rc ? rc : ended;
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
