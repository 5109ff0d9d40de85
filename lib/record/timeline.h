/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the time a sample arrived to the time it was acquired, for one stream.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival    (CLOCK_MONOTONIC, ns)
 *                                  arrival       ≥ 0
 *
 * Stamped by the kernel: the stamp less the delay. Not stamped: the line of the device's own
 * clock below all arrivals (envelope.h), less what the line is expected to be too high, less
 * the delay. The delay is that of the quickest samples; it is from calibration, with its
 * standard deviation.
 *
 * Times never stand still or run backwards, whatever the device says, so that readers may
 * rely on it. Nothing here allocates, locks or calls the system; the work per sample is
 * bounded. One thread at a time.
 */
#ifndef INCISE_TIMELINE_H
#define INCISE_TIMELINE_H

#include <stdbool.h>
#include <stdint.h>
#include "envelope.h"

struct incise_timeline_setup {
	bool stamped;	/* by the kernel, when it was acquired but for the delay */
	double rate_hz; /* nominal, 0.001 to 1e7; else no line can be drawn */
	int64_t delay_ns, delay_sd_ns;
	/* Not stamped: arrivals come on a grid, 1000000 for frames of USB; 0 for none. */
	int64_t grain_ns;
};

struct incise_timeline_report {
	uint64_t samples;
	double rate_hz;			/* measured */
	double drift_ppm, drift_sd_ppm; /* of the device's rate; fast is positive */
	double jitter_ns;		/* standard deviation of arrivals or stamps */
	double jitter_max_ns;		/* farthest above the line */
	uint64_t late;			/* more than a period above the line */
	int lines;	     /* begun: more than 1 after a gap in the device's clock */
	double offset_ns;    /* taken off from the line */
	double offset_sd_ns; /* of the time given to the last sample */
};

/* The line bends here: between two knots time is linear in the number. */
struct incise_timeline_knot {
	uint64_t seq;
	int64_t t_ns;
	double sd_ns;
	bool begins; /* a new line, which does not go on from the knot before */
};

#define INCISE_TIMELINE_KNOTS 256
#define INCISE_TIMELINE_KNOTS_MAX (INCISE_TIMELINE_KNOTS + 3) /* of a line that goes on */

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

/* @setup's delay is taken as it is; a rate that is no number or out of range: not known. */
void incise_timeline_begin(struct incise_timeline *timeline,
			   const struct incise_timeline_setup *setup);

/* Acquisition time of sample @seq: later than any before, and 0 or more. */
int64_t incise_timeline_sample(struct incise_timeline *timeline, uint64_t seq,
			       int64_t arrival_ns);

/* The device was plugged in again: numbers go on, but the phase of its clock is another. */
void incise_timeline_replug(struct incise_timeline *timeline);

/* What was seen up to now. What is not known is NaN. */
void incise_timeline_report(const struct incise_timeline *timeline,
			    struct incise_timeline_report *report);

/*
 * For streams without stamps: the best line afterwards, from what came before and after.
 * Returns the number of knots, at most INCISE_TIMELINE_KNOTS_MAX: 0 before two samples.
 */
int incise_timeline_knots(const struct incise_timeline *timeline,
			  struct incise_timeline_knot *knots);

/* Time of @seq between knots, or beyond the last of them; @n is 2 or more. */
int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n, uint64_t seq);

/* One line through all knots after the last begin. 0, or -ENODATA. */
int incise_timeline_line(const struct incise_timeline *timeline,
			 struct incise_timeline_line *line);

/* A stream that is stamped and of unknown rate; numbers are counted. */
void incise_timeline_init(struct incise_timeline *timeline, int64_t latency_ns);
int64_t incise_timeline_acquired(struct incise_timeline *timeline, int64_t arrival_ns);

#endif
