/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * When a sample of a card was taken that stamps nothing: from when blocks arrive and how
 * many samples they hold.
 *
 *   start T  2T  3T  4T  5T               sample n is taken at begin + (n + 1) T
 *     |---|---|---|---|---|···            blocks arrive late by what they wait in the card:
 *                   ▲         ▲           the least of it within a second is taken for
 *                block 1   block 2        constant, and what it drifts by moves begin
 *
 * A reader that was held up finds much waiting, which is no drift: only blocks that emptied
 * the kernel's buffer tell of it, eight of them at least, and no clock is off by 1000 ppm.
 *
 * Good to the card's least delay, which is not known from here: milliseconds with a card
 * that hands over its store when it is half full. No stamp is later than its arrival, and
 * each is later than the one before.
 */
#ifndef INCISE_COMEDI_STAMPS_H
#define INCISE_COMEDI_STAMPS_H

#include <stdbool.h>
#include <stdint.h>

struct comedi_stamps {
	double period_ns;
	int64_t begin_ns, last_ns;
	double shift_ns; /* drift of the card's clock since begin_ns */
	uint64_t n;	 /* samples since begin_ns */
	int64_t window_ns;
	int blocks;		   /* of this window that tell of the delay */
	double least_ns, usual_ns; /* delay: of this window, of the first one */
	bool has_usual;
};

/* @period_ns > 0 */
void comedi_stamps_init(struct comedi_stamps *stamps, double period_ns);
/* A command was started at @t_ns. */
void comedi_stamps_begin(struct comedi_stamps *stamps, int64_t t_ns);
/* A block of @n samples came at @t_ns; @last: no more was waiting behind it. */
void comedi_stamps_block(struct comedi_stamps *stamps, int64_t t_ns, uint64_t n,
			 bool last);
/* The time of the next sample of it. */
int64_t comedi_stamps_next(struct comedi_stamps *stamps);

#endif
