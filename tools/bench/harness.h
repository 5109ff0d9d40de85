/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Run times of variants of the same work: all on one processor, each warmed up before it is
 * timed, all in turns, with reference workloads among them.
 *
 *     turn 1               turn 2               turn 3
 *     references A B C     references A B C     references A B C   …
 *
 * A moment in which the machine is busy affects all of them. A time as a multiple of a reference
 * workload's in the same turn can be compared with another day's.
 */
#ifndef INCISE_HARNESS_H
#define INCISE_HARNESS_H

#include <math.h>

/*
 * Three kinds of fixed work, as no machine is slower evenly: beside a busy processor of the same
 * core, wide work takes half as long again, a chain as long as before. A change of them makes
 * older reports incomparable.
 *
 *   chain   each step waits for the one before: bound by latency
 *   wide    steps are independent: bound by how many the core does at once
 *   memory  a random walk through half a MiB: bound by the second cache
 */
enum workload { WORKLOAD_CHAIN, WORKLOAD_WIDE, WORKLOAD_MEMORY, WORKLOADS };

struct harness_variant {
	void (*run)(void *context);
	void *context;
	double units; /* done by a run: times are of one; 0 leaves the variant out */
	/* Instead of run(): warms up and times itself, returns ns of a unit. */
	double (*ns)(void *context);
	struct harness_time *time; /* the result */
};

/* Statistics of measured values in the order in which they came. */
struct harness_spread {
	double median, p5, p95; /* the percentiles from 20 values on, else NaN */
	double low, high;	/* 95 % interval of the median */
	double min, max;
};

#define HARNESS_SPREAD_NONE ((struct harness_spread){NAN, NAN, NAN, NAN, NAN, NAN, NAN})

struct harness_time {
	struct harness_spread ns;	     /* of one unit */
	struct harness_spread by[WORKLOADS]; /* as multiples of the workloads' */
};

/* Time n variants for so many turns, on one processor. Variants that are left out get NaN. On
 * SIGINT it ends after a turn and uses the turns so far. */
void harness_times(const struct harness_variant *variants, int n, int turns);

/* The same for times in ns that were taken elsewhere, in threads or other programs: the
 * reference workloads are timed now. NaN of none. */
void harness_time_of(const double *ns, int n, struct harness_time *time);

/* Statistics of n values in the order in which they came; NaN without values. The interval is by
 * ranks. From 24 values on it comes from the medians of 12 stretches of them, so that a slow
 * minute, which makes neighbours alike, does not narrow it. Below 6 values: the smallest, the
 * largest. */
void harness_spread(const double *values, int n, struct harness_spread *spread);

#endif
