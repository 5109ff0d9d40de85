// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Start-up and fading; see start.h.
 */
#include <math.h>
#include "start.h"

/* Of the force, in one tick: ticks are to be at least ten in a ramp. */
#define RISE_MOST 0.1

double incise_start_gain(struct incise_start *start, double wanted_N, bool fresh,
			 double dt_s)
{
	/* Values written from outside must not get out either. */
	double gain = start->gain > 0 ? fmin(start->gain, 1) : 0;

	if (fresh && fabs(wanted_N) <= start->small_N)
		start->released = true;
	if (!start->released) {
		gain = 0;
	} else if (fresh && dt_s > 0) {
		double rise = dt_s / start->ramp_s;

		/* No ramp at all, or none that is a number, is the steepest there is. */
		gain = fmin(gain + (rise >= 0 && rise < RISE_MOST ? rise : RISE_MOST), 1);
	} else if (!fresh && !(dt_s <= 0)) {
		double fall = dt_s / start->fade_s;

		gain = fall >= 0 && fall < gain ? gain - fall : 0;
	}
	start->gain = gain;
	return gain;
}
