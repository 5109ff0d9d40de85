/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Start-up and fading: the factor by which a force is let through. It waits for a small
 * force, so that a scene that starts with the blade deep in the tissue pushes nobody;
 * then it ramps up, and fades out when poses stop.
 *
 *   wanted_N   ----.            .-------------------
 *                   '-. small_N/
 *   gain  1             '-'  .------.        .------
 *         0   ______________/        \______/
 *             waits    ramp_s   fade_s      ramp_s
 *             poses ................        ........
 */
#ifndef INCISE_START_H
#define INCISE_START_H

#include <incise/export.h>
#include <stdbool.h>

struct incise_start {
	/* Settings. */
	double small_N;
	double ramp_s; /* from 0 to 1 */
	double fade_s; /* from 1 to 0; not above 0: at once */

	double gain; /* 0 … 1 */
	bool released;
};

/*
 * The gain of this tick.
 *
 * @wanted_N size of the force that is asked for, either sign; not a number is not small
 * @fresh    there is a pose young enough
 * @dt_s     since the last tick. What is not above 0 changes nothing. However long a stall
 *           was, a tick brings back a tenth of the force at most; it may take all of it.
 *           Not a number is no time while rising, and endless while fading.
 *
 * After a fade the gain rises again without waiting for a small force: the hand has not
 * left, and whoever holds the blade in the tissue would else feel nothing until it is out.
 * The ramp is the protection: what comes back does so in ramp_s, not at once.
 */
double incise_start_gain(struct incise_start *start, double wanted_N, bool fresh,
			 double dt_s) INCISE_REALTIME;

#endif
