/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How far the forces of a plan in integers are from those of the same plan in double, on the same poses, and
 * whether they are so by a decision: another phase, tool, flag or side of the tissue. That is no error of a force.
 */
#ifndef INCISE_TEST_APART_H
#define INCISE_TEST_APART_H

#include <math.h>
#include <incise/plan.h>
#include "../lib/base/vector.h"

/* cos 60°: normals farther apart are of two sides of a tissue, as where it was gone through. */
#define APART_SAME_SIDE 0.5

/* Rest of a difference that a decision made, as part of the bound. */
#define APART_ENDED 0.1

/* A tick of the slew's limit rounds a length, its share and three parts: by no more, each time that it holds. */
#define APART_SLEW_N (4 * 0x1p-16)

struct apart {
	bool is; /* by a decision, until the forces are as near as APART_ENDED once more */
	int slewed; /* ticks so far in a row */
};

/* A force that is slewed in one of them only began to change a tick earlier, as after a fade. */
static inline bool apart_decide_alike(const struct incise_tick *a,
				      const struct incise_tick *b)
{
	const unsigned int limits =
		INCISE_TICK_CLAMPED | INCISE_TICK_EXTRAPOLATED | INCISE_TICK_UNPAID;

	return a->phase == b->phase && a->tool == b->tool &&
	       !((a->flags ^ b->flags) & ~limits) &&
	       (a->phase == INCISE_PHASE_FREE ||
		v3_dot(a->normal, b->normal) > APART_SAME_SIDE);
}

/* @return the difference of a tick, N, less what the slew's limit rounded so far */
static inline double apart_N(struct apart *apart, const struct incise_tick *a,
			     const struct incise_tick *b, double bound_N)
{
	bool slewed = (a->flags | b->flags) & INCISE_TICK_SLEWED;
	double off[3], off_N;

	v3_sub(off, a->command_N, b->command_N);
	apart->slewed = slewed ? apart->slewed + 1 : 0;
	off_N = fmax(v3_length(off) - apart->slewed * APART_SLEW_N, 0);
	if (!apart_decide_alike(a, b))
		apart->is = true;
	/* What fades to nothing a tick later may return a tick later. */
	else if (off_N <= APART_ENDED * bound_N &&
		 (a->phase == INCISE_PHASE_FREE || !(a->flags & INCISE_TICK_STARTING)))
		apart->is = false;
	/* At the end of an account roundings decide, of nothing but this tick. */
	if ((a->flags | b->flags) & INCISE_TICK_UNPAID)
		return 0;
	return off_N;
}

#endif
