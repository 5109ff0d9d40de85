/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The work of hand and tissue on each other, mJ (N·mm).
 *
 *     tick      k-1             k
 *     force    f(k-1) ────────▶          held between them
 *     tool     x(k-1)          x(k)      work on the tissue: -f(k-1)·(x(k) - x(k-1))
 */
#ifndef INCISE_STATE_WORK_H
#define INCISE_STATE_WORK_H

#include <stdbool.h>
#include <incise/plan.h>

/* A sum that stays good over 1e9 additions; W. Kahan, CACM 8 (1965) 40. */
struct incise_sum {
	double value, error;
};

void incise_sum_add(struct incise_sum *sum, double value) INCISE_REALTIME;

/* Begins with {0}. */
struct incise_work {
	struct incise_sum absorbed; /* by the tissue */
	struct incise_sum returned; /* to the hand; ≥ 0 */
	double tool_mm[3], force_N[3];
	enum incise_tool tool;
	bool known; /* tool_mm and force_N are those of the last tick */
};

/* Real-time safe. */
void incise_work_add(struct incise_work *work,
		     const struct incise_tick *tick) INCISE_REALTIME;

#endif
