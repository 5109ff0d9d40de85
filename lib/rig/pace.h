/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Losses of a source that does not count its samples, by the times of the others.
 *
 *   lateness |   o  held up          o         two lost   o-----o----
 *            |    o               o                      |             stays: 2 T
 *          T |     o                                     |
 *          0 |--o---o--o---o---o------o----o----o--------'
 *            '------------------------------------------------------> samples
 *
 * Sample k is due at k periods T. It comes as late as a host, a network or a block holds it up, so
 * one late arrival shows nothing: only the least lateness of a window does. That of the samples
 * behind which no other one waited counts (they end a block), but for the lowest, which may have
 * a wrong time. A window lasts for 0.25 s, and for 8 of these, more the more their lateness scatters.
 * If the least lateness of two windows in a row has risen by whole periods, so many are missing. A
 * smaller change is drift, and the line follows: its slope is the period, fitted to the windows
 * so far. Where hardly any lateness scatters, six samples that are late by whole periods show as much.
 * A loss counts before the sample that shows it: up to three windows late.
 *
 * No loss:
 * - lateness that falls from window to window;
 * - times that rise by more than arrivals do (20 ms, and half of the rise): the clock was set;
 * - a change back: the line was too late, or the clock was set.
 *
 * Limits:
 * - The period may be off by 5 %; if a host looks at times of its own, by 0.2 %, and the caller says so.
 * - In the first five windows, and in the last three, a loss may be missing in the count; a source
 *   that loses some in each of the first is slow.
 * - A host that looks at a multiple of T, or nearly, now and then finds a sample one look later;
 *   from then on all are as late as if one had been lost. Nothing tells these apart: it is no
 *   loss, and @unsure is set, as where chunks scatter by more than 1.5 T.
 * - A loss of one next to lateness of single samples by T or more.
 * - A program that sends by sleeping has no period: where it slips, a loss counts.
 */
#ifndef INCISE_RIG_PACE_H
#define INCISE_RIG_PACE_H

#include <stdbool.h>
#include <stdint.h>

#define INCISE_PACE_OFF 0.2 /* of a source of which nothing is known */

struct incise_pace {
	double nominal_ns, period_ns; /* as given, and as known so far */
	double off;		      /* largest share by which these differ */
	unsigned int unit;	      /* losses are multiples of it */
	bool started, broken;
	bool unsure; /* losses may be missing in the count, see above */
	/* The line: a sample is due here that comes n periods later; windows that it was fitted to. */
	int64_t base_ns;
	uint64_t n;
	unsigned int fits;
	/* The last sample; samples of its block so far, and of the two blocks before. */
	int64_t last_ns;
	double late_ns;
	unsigned int run, runs[2];
	/* Least arrival less time so far, and in the last window. */
	double ahead_ns, before_ns;
	struct incise_pace_window {
		unsigned int samples;
		unsigned int fresh; /* none waited behind it */
		unsigned int
			shown; /* fresh ones of another lateness than the one before */
		unsigned int blocks; /* fresh ones that waited for others */
		unsigned int wraps;  /* changes by one period */
		/* The two lowest of the fresh, and their places. */
		double low_ns[2], low_n[2];
		double sum_ns, most_ns; /* of the changes between the fresh */
		double fresh_ns;	/* the last one */
		double ahead_ns;
	} window;
	/* Lateness of the last window, or 0 where it was fitted, at fitted_ns. */
	double rise_ns, fitted_ns;
	unsigned int fresh;   /* of the last fitted one */
	double behind;	      /* samples from its lowest to its end */
	double scatter_ns[2]; /* mean lateness above the least */
	/* A bit for each: several samples at a time; a rise behind a full block, so a loss. */
	unsigned int blocks, longer;
	/* Fresh samples since a step, the least lateness of these, and that before. */
	unsigned int steps;
	double step_ns, from_ns;
};

/*
 * @rate_hz > 0: nominal; the period is within a share of @off. @unit: 1; more if the sequence shows
 * all losses but multiples of it.
 */
void incise_pace_init(struct incise_pace *pace, double rate_hz, double off,
		      unsigned int unit);

/*
 * A sample of any time, which arrived at @arrival_ns: how many count as missing before it, of this
 * one or of earlier ones. Real-time safe.
 */
uint64_t incise_pace_add(struct incise_pace *pace, int64_t t_ns, int64_t arrival_ns);

/* Lateness of a sample of @t_ns that is the @steps-th after the last one, ns. */
double incise_pace_late(const struct incise_pace *pace, int64_t t_ns, uint64_t steps);

/* More than this is too early: no sample comes then. Infinite: not known yet. */
double incise_pace_early_ns(const struct incise_pace *pace);

/* If a block has the time of its last sample: how much earlier the one added last was taken, ns. */
int64_t incise_pace_spread_ns(const struct incise_pace *pace);

/* @n samples that do not come, or have no time, which others count. Real-time safe. */
void incise_pace_skip(struct incise_pace *pace, uint64_t n);

/* The link was gone: the gap before the next sample counts at once. */
void incise_pace_broken(struct incise_pace *pace);

#endif
