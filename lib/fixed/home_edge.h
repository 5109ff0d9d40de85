/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Lost steps, by passes of the home edge: the kernel module and the thread over GPIO compare each
 * with the edge that homing found. Positions in steps.
 *
 *   input  ■■■■■■■■■■■■■┐________________________________  position ─▶
 *                 ◀─────┴─── homing; passes this way are compared
 *              ▲        ▲
 *              at       passed, counted: lost = passed - at
 *
 * A switch opens at another place than it closes at, and a nut has play: passes the other way say
 * nothing. Where the edge was due and did not come, the way beyond it is lost at least.
 */
#ifndef INCISE_HOME_EDGE_H
#define INCISE_HOME_EDGE_H

#ifndef __KERNEL__
#include <stdbool.h>
#endif
#include "integers.h"

/* All 0: it was not passed yet. */
struct incise_home_edge {
	int64_t at;	   /* of the last pass until homed */
	int64_t lost;	   /* at the last pass since */
	int32_t direction; /* of the passes that are compared, +1 or -1; 0: the next one */
	bool fresh;	   /* it was passed since it was homed before */
	bool due;	   /* the motor comes from before it */
};

/*
 * Whether more steps are lost than @max; 0: any number may be. @passed: the input became active, while
 * the motor went in @direction, +1 or -1.
 */
static inline bool incise_home_edge_look(struct incise_home_edge *edge, bool homed,
					 bool passed, int64_t position, int32_t direction,
					 int64_t max)
{
	int64_t beyond = (position - edge->at) * edge->direction;

	if (passed && !(homed && edge->direction)) {
		edge->at = position;
		edge->direction = direction;
		edge->fresh = !homed;
		return false;
	}
	if (beyond < -max)
		edge->due = max;
	if (!homed ||
	    (passed ? direction != edge->direction : !edge->due || beyond <= max))
		return false;
	edge->due = false;
	edge->lost = position - edge->at;
	return max && (edge->lost > max || edge->lost < -max);
}

/* The place has another number, and is homed or not. */
static inline void incise_home_edge_rename(struct incise_home_edge *edge, int64_t by,
					   bool homed)
{
	edge->at += by;
	edge->due = false;
	if (!homed)
		return;
	if (!edge->fresh)
		edge->direction = 0;
	edge->fresh = false;
	edge->lost = 0;
}

#endif
