/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Losses of a source that does not count its samples, found by the times of the others.
 *
 *   lateness |            o  one held up               two lost   o--o--o--o
 *            |                                                    |
 *          T |               o                                    |  stays: 2 T
 *          0 |--o--o--o--o-----o--o--o--            --o--o--o--o--'
 *            '------------------------------------------------------------> samples
 *
 * Sample k is due at the first one's time and k periods T. Lateness that stays for a window of
 * half a second is a loss, rounded to whole periods, if it exceeds the scatter of the windows
 * before it: a loss that is shorter than the scatter cannot be seen. A smaller lateness moves
 * the line, as the clock of the source, and its period, drift. A hole of a quarter of a second,
 * and four periods, counts at once; in the first second, nothing else does.
 */
#ifndef INCISE_DEVICE_PACE_H
#define INCISE_DEVICE_PACE_H

#include <stdbool.h>
#include <stdint.h>

struct incise_pace {
	double nominal_ns, period_ns; /* as given, and as known so far */
	int64_t base_ns, last_ns;
	uint64_t n; /* periods since base_ns, which is moved to the end of each window */
	int64_t line_ns;
	uint64_t on_line; /* periods since line_ns, up to base_ns */
	bool started, broken;
	/* The window. */
	int64_t window_ns;
	uint64_t in_window;
	double least_ns, most_ns;
	/* Scatter of the last two windows; negative: no window yet. */
	double scatter_ns[2];
};

/* @rate_hz > 0: nominal; it may be off by a fifth. */
void incise_pace_init(struct incise_pace *pace, double rate_hz);

/*
 * A sample of any time: how many are missing before it. Times that run backwards by more than
 * a quarter of a second start a new line; they lose nothing. Real-time safe.
 */
uint64_t incise_pace_add(struct incise_pace *pace, int64_t t_ns);

/* The link was gone: the gap before the next sample counts at once. */
void incise_pace_broken(struct incise_pace *pace);

/* A sample without a time, which the others count. Real-time safe. */
void incise_pace_skip(struct incise_pace *pace);

#endif
