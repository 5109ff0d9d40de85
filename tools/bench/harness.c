// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Times of ways of doing the same thing; see harness.h.
 */
#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "harness.h"
#include "../cli/stopwatch.h"

#define YARDSTICK_RUNS 101

/* Stretches whose medians are ranked: from the 3rd to the 10th of 12 is an interval of
 * 1 - 2 (1 + 12 + 66) / 2^12 = 96 %. */
#define STRETCHES 12
#define STRETCH_RANK 2

int harness_cpu(void)
{
	cpu_set_t set;
	int last = 0;

	if (sched_getaffinity(0, sizeof(set), &set))
		return 0;
	for (int i = 0; i < CPU_SETSIZE; i++)
		if (CPU_ISSET(i, &set))
			last = i;
	return last;
}

/* Rank from below of a 95 % interval of the median of n < 24: the largest k for which less
 * than 2.5 % of all orders have k values or fewer on one side. */
static int rank_of(int n)
{
	double part = pow(0.5, n), sum = part;
	int k = 0;

	while (sum + part * (n - k) / (k + 1) <= 0.025) {
		part *= (double)(n - k) / (k + 1);
		sum += part;
		k++;
	}
	return k;
}

/* Of few: the upper one of two would lean to one side. */
static double median_of(const double *sorted, int n)
{
	return (sorted[(n - 1) / 2] + sorted[n / 2]) / 2;
}

static void interval_of_stretches(const double *values, int n,
				  struct harness_spread *spread)
{
	double medians[STRETCHES], *part = malloc(n * sizeof(*part));

	if (!part)
		cli_fail("no memory");
	for (int i = 0; i < STRETCHES; i++) {
		int from = (long long)n * i / STRETCHES,
		    to = (long long)n * (i + 1) / STRETCHES;

		memcpy(part, values + from, (to - from) * sizeof(*part));
		stopwatch_sort(part, to - from);
		medians[i] = median_of(part, to - from);
	}
	free(part);
	stopwatch_sort(medians, STRETCHES);
	spread->low = fmin(medians[STRETCH_RANK], spread->median);
	spread->high = fmax(medians[STRETCHES - 1 - STRETCH_RANK], spread->median);
}

void harness_spread(const double *values, int n, struct harness_spread *spread)
{
	double *sorted;

	*spread = (struct harness_spread){NAN, NAN, NAN, NAN, NAN};
	if (n < 1)
		return;
	sorted = malloc(n * sizeof(*sorted));
	if (!sorted)
		cli_fail("no memory");
	memcpy(sorted, values, n * sizeof(*sorted));
	stopwatch_sort(sorted, n);
	spread->median = stopwatch_quantile(sorted, n, 0.5);
	spread->p5 = stopwatch_quantile(sorted, n, 0.05);
	spread->p95 = stopwatch_quantile(sorted, n, 0.95);
	if (n >= 2 * STRETCHES) {
		interval_of_stretches(values, n, spread);
	} else {
		int rank = n < 6 ? 0 : rank_of(n);

		spread->low = sorted[rank];
		spread->high = sorted[n - 1 - rank];
	}
	free(sorted);
}

/* All n values as multiples of a unit each. */
static void ratios_spread(const double *ns, const double *units, int n, double *room,
			  struct harness_spread *spread)
{
	for (int i = 0; i < n; i++)
		room[i] = ns[i] / units[i];
	harness_spread(room, n, spread);
}

void harness_time_of(const double *ns, int n, struct harness_time *time)
{
	double runs[YARDSTICK_RUNS], *units = calloc(2 * (size_t)n + 1, sizeof(*units));

	if (!units)
		cli_fail("no memory");
	harness_spread(ns, n, &time->ns);
	for (int y = 0; y < YARDSTICKS; y++) {
		for (int i = 0; i < YARDSTICK_RUNS; i++)
			runs[i] = yardstick_ns((enum yardstick)y);
		stopwatch_sort(runs, YARDSTICK_RUNS);
		for (int i = 0; i < n; i++)
			units[i] = stopwatch_quantile(runs, YARDSTICK_RUNS, 0.5);
		ratios_spread(ns, units, n, units + n, &time->by[y]);
	}
	free(units);
}

static double run_ns(void *context)
{
	const struct harness_way *way = context;
	double begin;

	/* Its tables are in the cache, its branches learnt. */
	way->run(way->context);
	begin = stopwatch_ns();
	way->run(way->context);
	return (stopwatch_ns() - begin) / way->units;
}

/* On one processor; returns whether @before is to be restored. */
static bool pin(cpu_set_t *before)
{
	cpu_set_t one;

	if (sched_getaffinity(0, sizeof(*before), before))
		return false;
	CPU_ZERO(&one);
	CPU_SET(harness_cpu(), &one);
	return !sched_setaffinity(0, sizeof(one), &one);
}

void harness_timers(const struct harness_timer *timers, int n, int turns,
		    struct harness_time *times)
{
	/* Of each timer its turns, of each yardstick its turns, and room for as many. */
	double *ns = calloc((size_t)(n + YARDSTICKS + 1) * turns + 1, sizeof(*ns)),
	       *units;
	cpu_set_t before;
	bool pinned;
	int turn;

	if (!ns)
		cli_fail("no memory");
	units = ns + (size_t)n * turns;
	pinned = pin(&before);
	for (turn = 0; turn < turns && !cli_stop; turn++) {
		cli_progress("turn %d of %d", turn + 1, turns);
		for (int y = 0; y < YARDSTICKS; y++)
			units[y * turns + turn] = yardstick_ns((enum yardstick)y);
		for (int i = 0; i < n; i++)
			if (timers[i].ns)
				ns[(size_t)i * turns + turn] =
					timers[i].ns(timers[i].context);
	}
	cli_progress_end();
	if (pinned)
		sched_setaffinity(0, sizeof(before), &before);
	for (int i = 0; i < n; i++) {
		const double *own = ns + (size_t)i * turns;
		int taken = timers[i].ns ? turn : 0;

		harness_spread(own, taken, &times[i].ns);
		for (int y = 0; y < YARDSTICKS; y++)
			ratios_spread(own, units + y * turns, taken,
				      units + YARDSTICKS * turns, &times[i].by[y]);
	}
	free(ns);
}

void harness_times(const struct harness_way *ways, int n, int turns,
		   struct harness_time *times)
{
	struct harness_timer *timers = calloc((size_t)n + 1, sizeof(*timers));

	if (!timers)
		cli_fail("no memory");
	for (int i = 0; i < n; i++)
		if (ways[i].units > 0)
			timers[i] = (struct harness_timer){run_ns, (void *)&ways[i]};
	harness_timers(timers, n, turns, times);
	free(timers);
}
