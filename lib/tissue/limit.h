/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The last word on a force: never larger than a limit, never changing faster than one,
 * never anything but a number.
 */
#ifndef INCISE_LIMIT_H
#define INCISE_LIMIT_H

#include <stdbool.h>

struct incise_limit {
	double force_N;
	double slew_N; /* largest change in one tick */
	double last_N;
};

/* The force that may be rendered; *held tells whether it is not the one asked for. */
double incise_limit_apply(struct incise_limit *limit, double force_N, bool *held);

/* No force from now on, at once: for faults, where no slew applies. */
void incise_limit_zero(struct incise_limit *limit);

#endif
