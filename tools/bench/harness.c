// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Run times of variants of the same work; see harness.h.
 */
#include <math.h>
#include <sched.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/machine.h"
#include "harness.h"
#include "../cli/stopwatch.h"

#define WORKLOAD_RUNS 101

/* Stretches whose medians are ranked: from the 3rd to the 10th of 12 is an interval of
 * 1 - 2 (1 + 12 + 66) / 2^12 = 96 %. */
#define STRETCHES 12
#define STRETCH_RANK 2

/* --- reference workloads --- */

#define STEPS 8192
#define TABLE 1024
#define LINES 8192 /* of 64 bytes */
#define LINE_WORDS 8

static volatile double result; /* keeps the work from being left out */

static void chain(void)
{
	static double table[TABLE];
	uint64_t x = 88172645463325252u;
	double sum = 0;

	for (int i = 0; i < STEPS; i++) {
		x ^= x << 13;
		x ^= x >> 7;
		x ^= x << 17;
		sum = 0.75 * sum + table[x % TABLE];
		table[i % TABLE] = 1 + sum * 0x1p-8;
	}
	result = sum;
}

/* Six chains at once, of a multiplication, a sum and a load each. */
static void wide(void)
{
	static const uint32_t factor = 2891336453u;
	static uint32_t table[TABLE];
	uint32_t a = 1, b = 2, c = 3, d = 4, e = 5, f = 6, sum = 0;

	for (int i = 0; i < STEPS; i++) {
		a = a * factor + 1;
		b = b * factor + 3;
		c = c * factor + 5;
		d = d * factor + 7;
		e = e * factor + 9;
		f = f * factor + 11;
		sum += table[a % TABLE] + table[b % TABLE] + table[c % TABLE] +
		       table[d % TABLE] + table[e % TABLE] + table[f % TABLE];
	}
	table[0] = sum;
	result = sum;
}

static void memory(void)
{
	static uint32_t next[LINES * LINE_WORDS];
	uint32_t at = 0;

	/* An odd step through a power of two, mixed: a walk that comes by each line once. */
	if (!next[0])
		for (uint32_t i = 0; i < LINES; i++)
			next[i * LINE_WORDS] = (i * 5 + 4321) % LINES * LINE_WORDS;
	for (int i = 0; i < LINES; i++)
		at = next[at];
	result = at;
}

static double workload_ns(enum workload workload)
{
	static void (*const works[WORKLOADS])(void) = {chain, wide, memory};
	double begin;

	works[workload]();
	begin = stopwatch_ns();
	works[workload]();
	return stopwatch_ns() - begin;
}

/* --- medians and their intervals --- */

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
	double medians[STRETCHES], *part = cli_alloc(n, sizeof(*part));

	for (int i = 0; i < STRETCHES; i++) {
		int from = (long long)n * i / STRETCHES,
		    to = (long long)n * (i + 1) / STRETCHES;

		memcpy(part, values + from, (to - from) * sizeof(*part));
		/* For few values a quantile, the upper one of two, would lean to one side. */
		medians[i] = median(part, to - from);
	}
	free(part);
	stopwatch_sort(medians, STRETCHES);
	spread->low = fmin(medians[STRETCH_RANK], spread->median);
	spread->high = fmax(medians[STRETCHES - 1 - STRETCH_RANK], spread->median);
}

void harness_spread(const double *values, int n, struct harness_spread *spread)
{
	double *sorted;

	*spread = HARNESS_SPREAD_NONE;
	if (n < 1)
		return;
	sorted = cli_alloc(n, sizeof(*sorted));
	memcpy(sorted, values, n * sizeof(*sorted));
	stopwatch_sort(sorted, n);
	spread->median = stopwatch_quantile(sorted, n, 0.5);
	spread->p5 = stopwatch_quantile(sorted, n, 0.05);
	spread->p95 = stopwatch_quantile(sorted, n, 0.95);
	spread->min = sorted[0];
	spread->max = sorted[n - 1];
	if (n >= 2 * STRETCHES) {
		interval_of_stretches(values, n, spread);
	} else {
		int rank = n < 6 ? 0 : rank_of(n);

		spread->low = sorted[rank];
		spread->high = sorted[n - 1 - rank];
	}
	free(sorted);
}

/* --- timing --- */

static void spread_of_ratios(const double *ns, const double *units, int n, double *buffer,
			     struct harness_spread *spread)
{
	for (int i = 0; i < n; i++)
		buffer[i] = ns[i] / units[i];
	harness_spread(buffer, n, spread);
}

void harness_time_of(const double *ns, int n, struct harness_time *time)
{
	double runs[WORKLOAD_RUNS], *units = cli_alloc(2 * (size_t)n + 1, sizeof(*units));

	harness_spread(ns, n, &time->ns);
	for (int w = 0; w < WORKLOADS; w++) {
		for (int i = 0; i < WORKLOAD_RUNS; i++)
			runs[i] = workload_ns((enum workload)w);
		stopwatch_sort(runs, WORKLOAD_RUNS);
		for (int i = 0; i < n; i++)
			units[i] = stopwatch_quantile(runs, WORKLOAD_RUNS, 0.5);
		spread_of_ratios(ns, units, n, units + n, &time->by[w]);
	}
	free(units);
}

static double unit_ns(const struct harness_variant *variant)
{
	double begin;

	if (variant->ns)
		return variant->ns(variant->context);
	/* Its tables are in the cache, its branches learnt. */
	variant->run(variant->context);
	begin = stopwatch_ns();
	variant->run(variant->context);
	return (stopwatch_ns() - begin) / variant->units;
}

/* On one processor; returns whether @before is to be restored. */
static bool pin(cpu_set_t *before)
{
	cpu_set_t one;

	if (sched_getaffinity(0, sizeof(*before), before))
		return false;
	CPU_ZERO(&one);
	CPU_SET(machine_cpu(), &one);
	return !sched_setaffinity(0, sizeof(one), &one);
}

static bool is_timed(const struct harness_variant *variant)
{
	return variant->ns || variant->units > 0;
}

void harness_times(const struct harness_variant *variants, int n, int turns)
{
	/* For each variant its turns, for each workload its turns, and a buffer. */
	double *ns = cli_alloc((size_t)(n + WORKLOADS + 1) * turns + 1, sizeof(*ns)),
	       *units = ns + (size_t)n * turns;
	cpu_set_t before;
	bool pinned = pin(&before);
	int turn;

	for (turn = 0; turn < turns && !cli_stop; turn++) {
		cli_progress("turn %d of %d", turn + 1, turns);
		for (int w = 0; w < WORKLOADS; w++)
			units[w * turns + turn] = workload_ns((enum workload)w);
		for (int i = 0; i < n; i++)
			if (is_timed(&variants[i]))
				ns[(size_t)i * turns + turn] = unit_ns(&variants[i]);
	}
	cli_progress_end();
	if (pinned)
		sched_setaffinity(0, sizeof(before), &before);
	for (int i = 0; i < n; i++) {
		const double *own = ns + (size_t)i * turns;
		int taken = is_timed(&variants[i]) ? turn : 0;

		harness_spread(own, taken, &variants[i].time->ns);
		for (int w = 0; w < WORKLOADS; w++)
			spread_of_ratios(own, units + w * turns, taken,
					 units + WORKLOADS * turns,
					 &variants[i].time->by[w]);
	}
	free(ns);
}
