// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Times of ways of doing the same thing; see harness.h.
 */
#include <math.h>
#include <sched.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"
#include "harness.h"
#include "stopwatch.h"

/* Fixed work, some tens of microseconds of it: integers and doubles that wait for each
 * other, and a table in the first cache. Changing it makes older reports incomparable. */
#define YARDSTICK_STEPS 8192
#define YARDSTICK_TABLE 1024
#define YARDSTICK_RUNS 101

/* Stretches whose medians are ranked: from the 3rd to the 10th of 12 is an interval of
 * 1 - 2 (1 + 12 + 66) / 2^12 = 96 %. */
#define STRETCHES 12
#define STRETCH_RANK 2

static double yardstick_table[YARDSTICK_TABLE];
static volatile double yardstick_result;

static void yardstick(void)
{
	uint64_t x = 88172645463325252u;
	double sum = 0;

	for (int i = 0; i < YARDSTICK_STEPS; i++) {
		x ^= x << 13;
		x ^= x >> 7;
		x ^= x << 17;
		sum = 0.75 * sum + yardstick_table[x % YARDSTICK_TABLE];
		yardstick_table[i % YARDSTICK_TABLE] = 1 + sum * 0x1p-8;
	}
	yardstick_result = sum;
}

static double yardstick_ns(void)
{
	double begin;

	yardstick();
	begin = stopwatch_ns();
	yardstick();
	return stopwatch_ns() - begin;
}

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

static void interval_of_stretches(const double *values, int n,
				  struct harness_spread *spread)
{
	double medians[STRETCHES], *part = malloc(n * sizeof(*part));

	if (!part)
		cli_fail("no memory");
	for (int i = 0; i < STRETCHES; i++) {
		int from = (int64_t)n * i / STRETCHES,
		    to = (int64_t)n * (i + 1) / STRETCHES;

		memcpy(part, values + from, (to - from) * sizeof(*part));
		stopwatch_sort(part, to - from);
		medians[i] = stopwatch_quantile(part, to - from, 0.5);
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

void harness_time_of(const double *ns, int n, struct harness_time *time)
{
	double runs[YARDSTICK_RUNS], unit, *ratios = malloc((n + 1) * sizeof(*ratios));

	if (!ratios)
		cli_fail("no memory");
	for (int i = 0; i < YARDSTICK_RUNS; i++)
		runs[i] = yardstick_ns();
	stopwatch_sort(runs, YARDSTICK_RUNS);
	unit = stopwatch_quantile(runs, YARDSTICK_RUNS, 0.5);
	for (int i = 0; i < n; i++)
		ratios[i] = ns[i] / unit;
	harness_spread(ns, n, &time->ns);
	harness_spread(ratios, n, &time->yardsticks);
	free(ratios);
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
	double *ns = calloc((size_t)2 * n * turns + 1, sizeof(*ns)), *ratios;
	cpu_set_t before;
	bool pinned;
	int turn;

	if (!ns)
		cli_fail("no memory");
	ratios = ns + (size_t)n * turns;
	pinned = pin(&before);
	for (turn = 0; turn < turns && !cli_stop; turn++) {
		double unit = yardstick_ns();

		cli_progress("turn %d of %d", turn + 1, turns);
		for (int i = 0; i < n; i++) {
			if (!timers[i].ns)
				continue;
			ns[i * turns + turn] = timers[i].ns(timers[i].context);
			ratios[i * turns + turn] = ns[i * turns + turn] / unit;
		}
	}
	cli_progress_end();
	if (pinned)
		sched_setaffinity(0, sizeof(before), &before);
	for (int i = 0; i < n; i++) {
		int taken = timers[i].ns ? turn : 0;

		harness_spread(ns + i * turns, taken, &times[i].ns);
		harness_spread(ratios + i * turns, taken, &times[i].yardsticks);
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
