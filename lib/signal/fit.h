/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Rows whose time is not that of the line at their number, from the arrivals of a whole stream.
 *
 *     arrival - line |               o o o o o o o o           The records behind a loss that
 *                    |              |   o           |          only time shows have too low
 *             level  |              |               |          numbers until it is counted.
 *                  0 |--o--o-o--o-o-'               '-o-o--o-
 *                    '---------------------------------------> rows
 *
 * A record that the host held up is late alone, or arrives together with those behind it, and
 * the last of these is not late. So lateness that a whole window of fresh records has is a wrong
 * number, and a level that is no multiple of the period a wrong rate. The former rows move by whole
 * periods; the latter, and all rows of a stream without a line, are timed by their arrival.
 *
 * No clock, no file, no memory of its own but for the call.
 */
#ifndef INCISE_FIT_H
#define INCISE_FIT_H

#include <stddef.h>
#include <stdint.h>
#include "timeline.h"

/* Fresh records that show a level; fewer may be late by chance. */
#define INCISE_FIT_WINDOW 30

struct incise_fit_row {
	uint64_t seq;
	int64_t arrival_ns;
};

enum incise_fit_kind {
	INCISE_FIT_WIDER,   /* on the line, or not: the uncertainty covers both */
	INCISE_FIT_MOVED,   /* on the line, at another number */
	INCISE_FIT_ARRIVAL, /* timed by arrival: there is no line, or it does not fit */
};

/* The time of one row, in place of that on the line. */
struct incise_fit_time {
	uint64_t seq;
	int64_t t_ns;
	double held_ns; /* by the host, as others arrived with it; of INCISE_FIT_ARRIVAL */
	double sd_ns;
	enum incise_fit_kind kind;
};

struct incise_fit_setup {
	const struct incise_timeline_knot *knots;
	int n_knots;	  /* below 2: no line */
	double period_ns; /* of the device at its highest rate; above 0 */
	int64_t delay_ns; /* from acquisition to arrival */
	double delay_sd_ns;
	double grain_ns; /* arrivals are on a grid; 0: are not */
};

/*
 * @rows in the order of their numbers and arrivals. *@times gets, in order, those that are not
 * simply on the line, to be freed; NULL: none. Returns their number, or -ENOMEM.
 */
int64_t incise_fit(const struct incise_fit_setup *setup,
		   const struct incise_fit_row *rows, size_t n,
		   struct incise_fit_time **times);

#endif
