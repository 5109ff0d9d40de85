/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How many records were lost before this one. Time in ns.
 *
 * LIBERTY and PATRIOT count their frames. A FASTRAK does not: what is known is the order of
 * its stations, and time. The k-th record is measured at k periods and comes some time
 * later, never earlier; so it tells how late it is after the earliest that others were:
 *
 *   lateness |        one record held up        one record lost
 *            |                                       o--o--o--o--
 *          T |           o
 *            |              .                        stays: a record is missing
 *          0 |--o--o--o-----o--o--o--          --o--o
 *            '---------------------------------------------------> records
 *
 * Where stations are out of order, or half a record or more was none, the loss is told at once;
 * where only time tells, once the lateness stayed for POLHEMUS_GAPS_WINDOW records (0.5 s):
 * the number is right then, its place in seq is that much late. A drift between the
 * two clocks is followed. With sync from outside there is no period, and only
 * order and damage tell.
 */
#ifndef INCISE_POLHEMUS_GAPS_H
#define INCISE_POLHEMUS_GAPS_H

#include <stdbool.h>
#include <stdint.h>
#include "polhemus_records.h"

#define POLHEMUS_GAPS_WINDOW 60

struct polhemus_gaps {
	uint8_t order[POLHEMUS_STATIONS]; /* in which stations send */
	int n;
	bool counts;	   /* the device counts frames */
	int64_t period_ns; /* of records; 0: not known */
	unsigned int length;

	uint64_t lost, seq; /* so far; of the last record */
	bool started, begun, broken;
	bool anew;    /* the last record's periods begin anew, maybe with another phase */
	bool settled; /* base_ns is known: nothing came much earlier for a window */
	bool moved;   /* in this window something did */
	uint64_t first_place; /* of seq 0 in the order */
	int64_t base_ns;      /* the earliest that seq 0 could have come */
	int64_t last_ns;      /* of the last record; before the first: the start */
	int last;	      /* its place in the order */
	uint32_t frame;	      /* its count */
	unsigned int refused; /* in a row */
	/* The last one that was refused for its count. */
	uint32_t refused_frame;
	int64_t refused_ns;
	/* The window: the least lateness in it, that of its first record. */
	unsigned int in_window;
	int64_t least_ns, first_ns;
};

/* @hz: records of all stations per second; 0: not known. @length of a record in bytes. */
void polhemus_gaps_init(struct polhemus_gaps *gaps, const uint8_t *stations, int n,
			bool counts, double hz, unsigned int length);

/* The device was told to send at @t_ns: what does not come before the first record is lost. */
void polhemus_gaps_start(struct polhemus_gaps *gaps, int64_t t_ns);

/* The link was gone: before the next record all that time is lost. */
void polhemus_gaps_broken(struct polhemus_gaps *gaps);

/*
 * How many have not come for sure, when nothing did since the last record; not above what
 * counts as lost once one comes after polhemus_gaps_broken().
 */
uint64_t polhemus_gaps_silent(const struct polhemus_gaps *gaps, int64_t t_ns);

/* Its seq. false: it cannot be, as it came before it could; damaged, or there twice. */
bool polhemus_gaps_take(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			uint64_t *seq);

#endif
