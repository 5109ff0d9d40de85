/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The way of a host's tool between two of its steps: a line, or a cubic with the velocities at both ends.
 *
 *   host   ●───────────────────────────────●   from, to
 *   ticks      ╵   ╵   ╵   ╵   ╵   ╵   ╵   ╵   share 0 … 1 of the step
 */
#ifndef INCISE_HOST_PATH_H
#define INCISE_HOST_PATH_H

#include <stdbool.h>
#include "../base/vector.h"

/*
 * A host whose steps drift between the ticks: so many ticks more than in its longest step count as a hold, as that step
 * may end a tick later, and a mix of steps swung without the other. The last tick before a step may be one old.
 */
#define INCISE_HOST_SPARE 2

/* A host's steps in a loop of ticks: its poses, and the forces that it holds. */
struct incise_host_hold {
	int ticks;   /* from step to step; 1: a tracker's loop, without a host */
	bool drifts; /* between the ticks: see INCISE_HOST_SPARE */
	bool cubic;  /* the host gives velocities */
	bool fit;    /* a gain that is too large is lowered */
	double gain; /* in place of the scene's; 0: that. A refusal sets it to the largest that is safe */
};

struct incise_host_place {
	double at_mm[3], mm_s[3];
};

/* The place at a share of a step; with the speeds of both ends if @cubic. */
static inline void incise_host_between(double at_mm[3],
				       const struct incise_host_place *from,
				       const struct incise_host_place *to, double step_s,
				       double share, bool cubic)
{
	double rest = 1 - share;

	for (int i = 0; i < 3; i++) {
		double way_mm = to->at_mm[i] - from->at_mm[i];
		double off_mm = rest * (from->mm_s[i] * step_s - way_mm) -
				share * (to->mm_s[i] * step_s - way_mm);

		at_mm[i] = from->at_mm[i] + share * way_mm;
		if (cubic)
			at_mm[i] += share * rest * off_mm;
	}
}

#endif
