/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The lateness with which the machine wakes the haptic loop, idle and under loads, and cyclictest
 * of rt-tests at the same time on the same processor: a program that only sleeps and looks at the clock.
 */
#ifndef INCISE_WAKEUP_H
#define INCISE_WAKEUP_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>
#include <incise/realtime.h>
#include "../cli/file.h"
#include "metrics.h"

/* Nothing, stress-ng on processors, memory or disk, or `incise view` at 60 frames a second. */
enum load_kind { LOAD_IDLE, LOAD_CPU, LOAD_MEMORY, LOAD_DISK, LOAD_VIEW, LOADS };
extern const char *const load_names[LOADS + 1]; /* end with NULL */

/* Wake-ups of one program, us; NaN: not measured. Quantiles are upper edges of bins. */
struct lateness {
	double median, p99, p999, max;
	uint64_t ticks;
	json_t *json; /* {"min", "median", …, "ticks"}, or null */
};

/* Its memory is never freed. */
struct wakeup {
	const char *load;
	double rate_hz;
	const char *no_load;	   /* why it was not measured, or NULL */
	const char *no_cyclictest; /* why there is no cyclictest next to it, or NULL */
	struct lateness loop, cyclictest;
	struct harness_spread median, p999; /* of the loop, with their intervals */
	double ratio;	  /* of the 99.9 %, the loop's by cyclictest's */
	uint64_t skipped; /* ticks of the loop */
	double machine; /* of these, while cyclictest was held up as well; NaN: unknown */
	double tick_us; /* median after each sleep, with cold caches */
	double tick_max_us;
	double frames_hz; /* drawn meanwhile by the view, or NaN */
};

#define WAKEUPS_MAX (2 * LOADS)

struct wakeups {
	struct wakeup row[WAKEUPS_MAX];
	int n;
	double seconds; /* of each */
	bool realtime;	/* SCHED_FIFO and locked memory, else the shell's policy */
	int cpu;	/* of both programs */
};

/* Measure a scene's file at its rate; with NULL the scene that @own makes, at 1 and 4 kHz. @only: a
 * load, or LOADS for all, which with @quick are few. */
void wakeups_measure(const char *scene, struct memory_file (*own)(double rate_hz),
		     enum load_kind only, bool quick, double seconds,
		     struct wakeups *wakeups);

/* As incise haptic asks for it, with the CPU; NULL where it is not granted. */
struct incise_realtime *wakeup_realtime(int cpu);

#endif
