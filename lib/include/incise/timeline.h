/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the time a sample arrived to the time it was acquired, for one stream: what a
 * recorder does, for those who read a device themselves. Part of libincise-record.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival    (CLOCK_MONOTONIC, ns)
 *                                  arrival       ≥ 0
 *
 * Stamped by the kernel: the stamp less the delay. Not stamped: the line of the device's own
 * clock below all arrivals, less what the line is expected to be too high, less the delay.
 * The delay is that of the quickest samples; it is from calibration, with its standard
 * deviation. `incise bench timeline` measures how far off that is.
 *
 * Times never stand still or run backwards, whatever the device says, so that readers may
 * rely on it. The work per sample is bounded; nothing but new and free allocates, locks or
 * calls the system. One thread at a time.
 */
#ifndef INCISE_TIMELINE_H
#define INCISE_TIMELINE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** What is known of a stream before its first sample. */
struct incise_timeline_setup {
	bool stamped;	/**< by the kernel, when it was acquired but for the delay */
	double rate_hz; /**< nominal, 0.001 to 1e7; else no line can be drawn */
	int64_t delay_ns, delay_sd_ns;
	/** Not stamped: arrivals come on a grid, 1000000 for frames of USB; 0 for none. */
	int64_t grain_ns;
};

/** What its samples showed. */
struct incise_timeline_report {
	uint64_t samples;
	double rate_hz;			/**< measured */
	double drift_ppm, drift_sd_ppm; /**< of the device's rate; fast is positive */
	double jitter_ns;		/**< standard deviation of arrivals or stamps */
	double jitter_max_ns;		/**< farthest above the line */
	uint64_t late;			/**< more than a period above the line */
	int lines;	     /**< begun: more than 1 after a gap in the device's clock */
	double offset_ns;    /**< taken off from the line */
	double offset_sd_ns; /**< of the time given to the last sample */
};

/** The line bends here: between two knots time is linear in the number. */
struct incise_timeline_knot {
	uint64_t seq;
	int64_t t_ns;
	double sd_ns;
	bool begins; /**< a new line, which does not go on from the knot before */
};

/** At most, of one line. */
#define INCISE_TIMELINE_KNOTS 256
#define INCISE_TIMELINE_KNOTS_MAX \
	(INCISE_TIMELINE_KNOTS + 3) /**< of a line that goes on */

struct incise_timeline;

/**
 * @param setup its delay is taken as it is; a rate that is no number or out of range: not
 *              known
 * @return to be freed with incise_timeline_free(); NULL with errno ENOMEM
 */
INCISE_API struct incise_timeline *incise_timeline_new(
	const struct incise_timeline_setup *setup);
/** NULL is accepted. */
INCISE_API void incise_timeline_free(struct incise_timeline *timeline);

/** Acquisition time of sample seq: later than any before, and 0 or more. */
INCISE_API int64_t incise_timeline_sample(struct incise_timeline *timeline, uint64_t seq,
					  int64_t arrival_ns);

/**
 * The device was plugged in again: numbers go on, but the phase of its clock is another.
 */
INCISE_API void incise_timeline_replug(struct incise_timeline *timeline);

/** What was seen up to now. What is not known is NaN. */
INCISE_API void incise_timeline_report(const struct incise_timeline *timeline,
				       struct incise_timeline_report *report);

/**
 * For streams without stamps: the best line afterwards, from what came before and after.
 *
 * @param knots room for INCISE_TIMELINE_KNOTS_MAX
 * @return the number of knots: 0 before two samples
 */
INCISE_API int incise_timeline_knots(const struct incise_timeline *timeline,
				     struct incise_timeline_knot *knots);

/** Time of seq between knots, or beyond the last of them; n is 2 or more. */
INCISE_API int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n,
				      uint64_t seq);

INCISE_END_DECLS
#endif
