/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the time a sample arrived to the time it was acquired, for one stream.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival    (CLOCK_MONOTONIC, ns)
 *                                  arrival       ≥ 0
 *
 * With timestamps of the kernel: the timestamp less the delay. Without: the line of the
 * device's own clock below all arrivals (envelope.h), less the expected error of the line, less
 * the delay. The delay is that of the quickest samples; it comes from calibration, with its
 * standard deviation. `incise bench timeline` measures the error.
 *
 * Times increase strictly, whatever the device sends. The work per sample is bounded; nothing
 * here allocates, locks or calls the system. For one thread at a time.
 */
#ifndef INCISE_TIMELINE_H
#define INCISE_TIMELINE_H

#include <stdbool.h>
#include <stdint.h>
#include "envelope.h"

/* A stream before its first sample. */
struct incise_timeline_setup {
	bool timestamped; /* by the kernel, at the acquisition but for the delay */
	double rate_hz;	  /* nominal, 0.001 to 1e7; else no line can be drawn */
	int64_t delay_ns, delay_sd_ns;
	/* Without timestamps: arrivals come on a grid, 1000000 for frames of USB; 0 for none. */
	int64_t grain_ns;
};

/* Measured from the samples; NaN: not known. */
struct incise_timeline_report {
	uint64_t samples;
	double rate_hz;
	double drift_ppm, drift_sd_ppm; /* of the device's rate; fast is positive */
	double jitter_ns;		/* standard deviation of arrivals or timestamps */
	double jitter_max_ns;		/* farthest above the line */
	uint64_t late;			/* more than a period above the line */
	int lines;	     /* started: more than 1 after a gap in the device's clock */
	double offset_ns;    /* subtracted from the line */
	double offset_sd_ns; /* of the time of the last sample */
};

/* The line bends here: between two knots time is linear in the number. */
struct incise_timeline_knot {
	uint64_t seq;
	int64_t t_ns;
	double sd_ns;
	bool starts; /* a new line, which does not continue from the knot before */
};

#define INCISE_TIMELINE_KNOTS 256
/* Knots at most, those of the line's present end included. */
#define INCISE_TIMELINE_KNOTS_MAX (INCISE_TIMELINE_KNOTS + 3)

struct incise_timeline {
	struct incise_timeline_setup setup;
	double period_ns; /* nominal; 0: not known */
	int64_t last_ns;  /* the time returned last */
	uint64_t samples, last_seq;
	int64_t last_arrival_ns;

	/* x = (seq - base_seq) · period, y = arrival - base - x */
	bool started;
	uint64_t base_seq;
	int64_t base_ns;
	struct incise_envelope envelope;
	int lines, restarts;

	double jitter_n, jitter_mean_ns, jitter_sum2, jitter_max_ns;
	uint64_t late;

	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS];
	int knot_count;
	bool knot_started;   /* the present line has its first knot */
	double knot_x_ns;    /* the last knot, on the present line */
	double knot_step_ns; /* to the next */
};

/* A rate that is NaN or out of range counts as unknown. */
void incise_timeline_init(struct incise_timeline *timeline,
			  const struct incise_timeline_setup *setup);

/* Acquisition time of sample seq: later than any before, and 0 or more. */
int64_t incise_timeline_sample(struct incise_timeline *timeline, uint64_t seq,
			       int64_t arrival_ns);

/* The device was plugged in again: numbers continue, but its clock has another phase. */
void incise_timeline_replug(struct incise_timeline *timeline);

void incise_timeline_report(const struct incise_timeline *timeline,
			    struct incise_timeline_report *report);

/*
 * For streams without timestamps: the best line afterwards, from the samples before and after.
 * @knots has INCISE_TIMELINE_KNOTS_MAX elements. Returns their number; 0 before two samples.
 */
int incise_timeline_knots(const struct incise_timeline *timeline,
			  struct incise_timeline_knot *knots);

/* Time of seq between knots, or beyond the last of them; n is 2 or more. */
int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n, uint64_t seq);
/* Its standard deviation, ns: the larger one of the two knots around. */
double incise_timeline_sd(const struct incise_timeline_knot *knots, int n, uint64_t seq);

#endif
