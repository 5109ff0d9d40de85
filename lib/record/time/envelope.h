/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The line below which no arrival of a stream lies: bounded memory, O(1) per sample.
 *
 *     y │  ·    ·      ·  ·         y: arrival less (number · nominal period), ns
 *       │    ·      ·   ·    ·      x: number · nominal period, ns
 *       │ ·    ·  ·    __·──        the line touches two of the lowest; its slope is the
 *       │  ·___─·──·───             relative error of the nominal period
 *       └──────────────────► x
 *
 * The lowest arrival of each block of x is kept, for 64 blocks at most. A block starts as one
 * period or two and doubles whenever the 64 are full, up to BLOCK_MAX_NS; after that the oldest
 * blocks are dropped, so that the line follows a clock that warms up.
 *
 * The line maximizes its own height over the blocks under the condition that none is below
 * it, which is the most likely line for exponential excess: Moon, Skelly and Towsley,
 * "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999.
 * Even the lowest arrivals are a little late: see "gap".
 */
#ifndef INCISE_ENVELOPE_H
#define INCISE_ENVELOPE_H

#include <stdbool.h>
#include <stdint.h>

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

/* Standard deviation of line less gap at x. */
double incise_envelope_sd(const struct incise_envelope *env, double x_ns);

/* Largest distance of a straight line from a clock whose rate changes. */
double incise_envelope_bend(double span_ns);

/* All blocks have full length: the line in the middle gets no better. */
bool incise_envelope_full(const struct incise_envelope *env);

#endif
