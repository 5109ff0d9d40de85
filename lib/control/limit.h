/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The last word on a force: never larger than a limit, never changing faster than one,
 * never anything but numbers. Sizes are lengths of vectors; a force that is held keeps its
 * direction, a change that is held keeps the direction of the change.
 *
 *        .--force_N--.
 *      .'      o asked
 *     /      .'
 *    |     o' rendered      a step of slew_N towards it,
 *    |    / last            inside the ball
 *     '.     0     .'
 */
#ifndef INCISE_LIMIT_H
#define INCISE_LIMIT_H

#include <incise/export.h>
struct incise_limit {
	/* Settings; none at or below 0, and not a number, is 0. */
	double force_N;
	double slew_N; /* largest change in one tick */
	double last_N[3];
};

/* The limits that a force met, bits. */
enum incise_limit_event {
	INCISE_LIMIT_FORCE = 1,
	INCISE_LIMIT_SLEW = 2,
	INCISE_LIMIT_NOT_FINITE = 4,
};

/*
 * The force that may be rendered, in the place of the one asked for. Its length, the root
 * of the sum of squares as computed, is not above force_N; when that limit holds, it is
 * a few ulp less. The change is not above slew_N by more than 8 DBL_EPSILON of force_N,
 * which is rounding. One that has a component which is not finite asks for no force, and
 * is gone at the rate of the slew. Where both limits cannot be kept, as when force_N is
 * made smaller, it is the force that is.
 *
 * Returns which of them held it back: a bit for each, 0 if it is as asked for.
 */
unsigned int incise_limit_apply(struct incise_limit *limit,
				double force_N[3]) INCISE_REALTIME;

/* No force from now on, at once: for faults, where no slew applies. */
void incise_limit_zero(struct incise_limit *limit) INCISE_REALTIME;

#endif
