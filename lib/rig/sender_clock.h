/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Timestamps of a sender's own wall clock on the clock here. Arrivals are late by the network: the
 * least of arrival less timestamp, of the last 5 to 10 s, maps them, so that a sample's time is
 * that of an arrival which no network delayed.
 *
 *   arrival - timestamp |   o      o                o
 *                       | o   o o     o o  o  o  o      least of 10 s: the offset
 *                       '-------------------------------> time
 */
#ifndef INCISE_RIG_SENDER_CLOCK_H
#define INCISE_RIG_SENDER_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/* Zeros at the start of a connection. */
struct incise_sender_clock {
	bool is_mapped;
	/* The last timestamp; the start of a window of 5 s; the least of it, and of the one before. */
	int64_t stamp_ns, window_ns, least_ns[2];
};

/* The time of what was sent at @stamp_ns > 0, since 1970 and before 2106, and arrived at @t_ns. */
int64_t incise_sender_time(struct incise_sender_clock *clock, int64_t stamp_ns,
			   int64_t t_ns);

#endif
