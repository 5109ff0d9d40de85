/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * cyclictest of rt-tests beside our own loop: what the same machine does at the same moment
 * to a program that only sleeps and looks at the clock.
 */
#ifndef INCISE_CYCLICTEST_H
#define INCISE_CYCLICTEST_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>
#include "../cli/file.h"

/* A wake-up that was late by more than a quarter of a period. */
struct cyclictest_spike {
	int64_t from_ns, to_ns; /* when it was due, when it came; CLOCK_MONOTONIC */
};

struct cyclictest {
	pid_t pid;
	struct memory_file report, out;
};

struct cyclictest_result {
	uint64_t *late_us; /* INCISE_LOOP_BINS bins of 1 µs, the last one all above */
	uint64_t cycles;
	double max_us;
	struct cyclictest_spike *spike; /* in order of time */
	int spikes;
};

/*
 * Whether it can run: it is installed, and does without what this process may not do.
 * Returns NULL, or why not.
 */
const char *cyclictest_possible(bool realtime);

/*
 * Start it with one thread of SCHED_FIFO on a processor, for so many wake-ups, each so long
 * after where one would be that counts from a full second of CLOCK_MONOTONIC. It begins with
 * the next second, when that is not to come within half a second.
 */
void cyclictest_begin(struct cyclictest *c, double rate_hz, int priority, int cpu,
		      uint64_t cycles, double phase_us);

/*
 * Wait for its end and take what it says. Returns NULL or why there is nothing; what the
 * result holds is the caller's, to be given to cyclictest_free().
 */
const char *cyclictest_end(struct cyclictest *c, struct cyclictest_result *result);

void cyclictest_free(struct cyclictest_result *result);

#endif
