// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Work between hand and tissue; see state_work.h.
 */
#include "../base/vector.h"
#include "state_work.h"

/* In a day at 1 kHz nobody does more between two ticks; beyond it the sums would end. */
#define WORK_MAX_mJ 1e9

void incise_sum_add(struct incise_sum *sum, double value)
{
	double more = value - sum->error;
	double next = sum->value + more;

	sum->error = (next - sum->value) - more;
	sum->value = next;
}

void incise_work_add(struct incise_work *work, const struct incise_tick *tick)
{
	bool known = !(tick->flags & (INCISE_TICK_STALE | INCISE_TICK_FAULT));
	double way_mm[3], work_mJ;

	/* From one tool to the other is no motion. */
	if (known && work->known && tick->tool == work->tool) {
		v3_sub(way_mm, tick->tool_mm, work->tool_mm);
		work_mJ = -v3_dot(work->force_N, way_mm);
		if (work_mJ > 0 && work_mJ < WORK_MAX_mJ)
			incise_sum_add(&work->absorbed, work_mJ);
		else if (work_mJ < 0 && work_mJ > -WORK_MAX_mJ)
			incise_sum_add(&work->returned, -work_mJ);
	}
	v3_copy(work->tool_mm, tick->tool_mm);
	v3_copy(work->force_N, tick->command_N);
	work->tool = tick->tool;
	work->known = known;
}
