/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How incise bench times ways of doing the same thing: all on one processor, each warmed up
 * before it is timed, all taking turns, and yardsticks among them.
 *
 *     turn 1               turn 2               turn 3
 *     yardsticks A B C     yardsticks A B C     yardsticks A B C   …
 *
 * A moment in which the machine is busy meets them all. A time as a multiple of a
 * yardstick's in the same turn can be held against one of another day.
 */
#ifndef INCISE_HARNESS_H
#define INCISE_HARNESS_H

#include "yardstick.h"

struct harness_way {
	void (*run)(void *context);
	void *context;
	double units; /* done by a run: times are of one; 0 leaves the way out */
};

/* Of measured values in the order in which they came. */
struct harness_spread {
	double median, p5, p95;
	double low, high; /* 95 % interval of the median */
};

struct harness_time {
	struct harness_spread ns;	      /* of one unit */
	struct harness_spread by[YARDSTICKS]; /* the same as multiples of yardsticks */
};

/*
 * Time n ways for so many turns. Ways that are left out get NaN. The process is back on the
 * processors that it had before when it returns; fails the program without memory. On
 * SIGINT it ends after a turn, with those that were taken.
 */
void harness_times(const struct harness_way *ways, int n, int turns,
		   struct harness_time *times);

/* One that warms up and times itself: returns ns of a unit. NULL leaves it out. */
struct harness_timer {
	double (*ns)(void *context);
	void *context;
};

/* The same of these. */
void harness_timers(const struct harness_timer *timers, int n, int turns,
		    struct harness_time *times);

/*
 * The same of times in ns that were taken elsewhere, in threads or other programs: the
 * yardsticks are timed now. NaN of none.
 */
void harness_time_of(const double *ns, int n, struct harness_time *time);

/*
 * Of n values in the order in which they came; NaN of none. The interval is by ranks, and
 * assumes no distribution. From 24 values on it is one of the medians of 12 stretches of
 * them, so that a slow minute, which makes neighbours alike, does not make it narrow. Below
 * 6 values it is all that there is: the smallest and the largest.
 */
void harness_spread(const double *values, int n, struct harness_spread *spread);

/* The processor that ways are timed on: the last one, as interrupts are more often the
 * first one's. */
int harness_cpu(void);

#endif
