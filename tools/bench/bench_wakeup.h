/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How late the machine wakes the haptic loop, idle and under loads, and cyclictest at the
 * same time.
 */
#ifndef INCISE_BENCH_WAKEUP_H
#define INCISE_BENCH_WAKEUP_H

#include <jansson.h>
#include <stdbool.h>
#include "bench_load.h"
#include "metrics.h"
#include "wakeup_run.h"

struct wakeup_row {
	enum load load;
	double rate_hz;
	const char *no_load; /* why it was not measured, or NULL */
	struct wakeup got;
	double frames_hz; /* pictures drawn meanwhile, of the view; or NaN */
};

struct wakeups {
	struct wakeup_row *row;
	int n;
	double seconds; /* of each */
	bool realtime;	/* SCHED_FIFO and locked memory, else what the shell has */
	int cpu;	/* of both programs */
};

/*
 * @scene: or NULL for the bench's own, at 1 and 4 kHz; @only: a load, or LOADS for all,
 * which with @quick are few. The rows live as long as the program.
 */
void bench_wakeup(const char *scene, enum load only, bool quick, double seconds,
		  struct wakeups *wakeups);

/* As incise haptic asks for it, with the CPU; NULL where it is not granted. */
struct incise_realtime *wakeup_realtime(int cpu);

/* {"min", "median", "p99", "p999", "p9999", "max", "ticks"}, or null. */
json_t *lateness_json(const struct lateness *lateness);

json_t *wakeups_json(const struct wakeups *wakeups);
/* Lateness of the loop under each load. */
void wakeups_figures(const struct wakeups *wakeups, json_t *figures);
void wakeups_print(const struct wakeups *wakeups);

#endif
