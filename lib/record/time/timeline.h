/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A timeline as it is inside; see incise/timeline.h. Nothing here allocates, locks or calls
 * the system.
 */
#ifndef INCISE_TIMELINE_PRIVATE_H
#define INCISE_TIMELINE_PRIVATE_H

#include <incise/timeline.h>
#include "envelope.h"

struct incise_timeline_line {
	uint64_t seq;
	int64_t ns;
	double period_ns;
	double sd_ns; /* of the line against the truth, bends of the knots with it */
};

struct incise_timeline {
	struct incise_timeline_setup setup;
	double period_ns; /* nominal; 0: not known */
	int64_t last_ns;  /* given out last */
	uint64_t samples, last_seq;
	int64_t last_arrival_ns;

	/* x = (seq - base_seq) · period, y = arrival - base - x */
	bool begun;
	uint64_t base_seq;
	int64_t base_ns;
	struct incise_envelope envelope;
	int lines, restarts;

	double jitter_n, jitter_mean_ns, jitter_sum2, jitter_max_ns;
	uint64_t late;

	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS];
	int knot_count;
	bool knot_begun;     /* this line has its first */
	double knot_x_ns;    /* the last, on this line */
	double knot_step_ns; /* to the next */
};

/* As incise_timeline_new(), in the caller's memory. */
void incise_timeline_begin(struct incise_timeline *timeline,
			   const struct incise_timeline_setup *setup);

/* One line through all knots after the last begin. 0, or -ENODATA. */
int incise_timeline_line(const struct incise_timeline *timeline,
			 struct incise_timeline_line *line);

/* A stream that is stamped and of unknown rate; numbers are counted. */
void incise_timeline_init(struct incise_timeline *timeline, int64_t latency_ns);
int64_t incise_timeline_acquired(struct incise_timeline *timeline, int64_t arrival_ns);

#endif
