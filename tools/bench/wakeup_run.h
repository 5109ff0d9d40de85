/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * One measurement of how late the loop's thread wakes, and of cyclictest beside it.
 */
#ifndef INCISE_WAKEUP_RUN_H
#define INCISE_WAKEUP_RUN_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/realtime.h>

struct wakeup_setup {
	const char *scene; /* path */
	double rate_hz, seconds;
	const struct incise_realtime *realtime; /* NULL: what policy the shell has */
	bool beside;				/* cyclictest, on the same processor */
	int cpu;
};

/* Of the wake-ups of one program, us. Quantiles are upper edges of bins of 1 us. */
struct lateness {
	double min, median, p99, p999, p9999, max;
	uint64_t ticks;
	uint64_t *bins; /* INCISE_LOOP_BINS of 1 us, or NULL: not measured; never freed */
};

struct wakeup {
	struct lateness loop, cyclictest;
	const char *no_cyclictest; /* why there is nothing beside it, or NULL */
	double ratio;	  /* of the 99.9 %, the loop's by cyclictest's; NaN without it */
	uint64_t skipped; /* ticks of the loop */
	uint64_t machine; /* of these, while cyclictest was held up as well */
	double tick_max_us;
};

/* Measure; a loop that fails fails the program. */
void wakeup_run(const struct wakeup_setup *setup, struct wakeup *wakeup);

#endif
