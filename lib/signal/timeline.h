/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the time a sample arrived to the time it was acquired, for one stream.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival    (CLOCK_MONOTONIC, ns)
 *                                  arrival       ≥ 0
 *
 * With timestamps of the kernel: the timestamp less the delay. Without: the line of the
 * device's own clock below all arrivals (the envelope), less the expected error of the line, less
 * the delay. The delay is that of the quickest samples; it comes from calibration, with its
 * standard deviation. tests/bench/timeline measures the error.
 *
 * Times increase strictly, whatever the device sends. The work per sample is bounded; nothing
 * here allocates, locks or calls the system. For one thread at a time.
 */
#ifndef INCISE_TIMELINE_H
#define INCISE_TIMELINE_H

#include <stdbool.h>
#include <stdint.h>

/* --- the line below all arrivals ----------------------------------------------------- */

#define INCISE_ENVELOPE_BLOCKS 64
#define INCISE_ENVELOPE_BLOCK_MAX_NS 500000000LL
/*
 * Largest deviation from the nominal period. Crystals are within 100 ppm; RC oscillators of
 * cheap devices are not.
 */
#define INCISE_ENVELOPE_SLOPE_MAX 2e-3

struct incise_envelope_block {
	int64_t number; /* x / block_ns */
	double x_ns, y_ns;
};

struct incise_envelope {
	struct incise_envelope_block blocks[INCISE_ENVELOPE_BLOCKS];
	int count;
	struct incise_envelope_block open; /* not yet in blocks */
	bool has_open;
	double block_ns, period_ns, grain_ns;

	/* The line: y = y_ns + slope · (x - x_ns), in the middle of the blocks. */
	bool has_line;
	double x_ns, y_ns, slope;
	/* The true line is expected to be lower by the gap. */
	double gap_ns, gap_sd_ns, slope_sd;
	double measured_sd; /* of the slope, by the samples alone */
	/* The slope expected while there are few blocks. */
	double prior_slope, prior_slope_sd;
	/* The excess of the blocks' lowest is Weibull: shape and scale near its lower end. */
	double log_ratio, shape, scale_ns; /* scale 0: not known */
	int shape_fits;
	/* New lines, because all blocks were far above the old one. */
	int restarts;
};

/*
 * period_ns is positive and finite. Arrivals that come on a grid of grain_ns (frames of USB)
 * have a jitter that hardly changes when the grid and the period fit; 0: there is no grid.
 */
void incise_envelope_init(struct incise_envelope *env, double period_ns, double grain_ns);

/*
 * Add an arrival; x_ns grows from call to call, from 0 or more, and both are below 1e16 in
 * size. Returns true when the line was drawn again.
 */
bool incise_envelope_add(struct incise_envelope *env, double x_ns, double y_ns);

/* The line's height at x, without the gap. */
double incise_envelope_at(const struct incise_envelope *env, double x_ns);

/* All blocks have full length: the line in the middle gets no better. */
bool incise_envelope_full(const struct incise_envelope *env);

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
