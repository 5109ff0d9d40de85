// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tick in fixed widths, for the state page.
 */
#include <errno.h>
#include "../base/vector.h"
#include "state_page.h"

void incise_state_pack(struct state_tick *to, const struct incise_tick *from)
{
	to->t_ns = from->t_ns;
	v3_copy(to->position_mm, from->position_mm);
	v3_copy(to->tool_mm, from->tool_mm);
	v3_copy(to->proxy_mm, from->proxy_mm);
	v3_copy(to->normal, from->normal);
	for (int i = 0; i < 4; i++)
		to->quaternion[i] = from->quaternion[i];
	to->depth_mm = from->depth_mm;
	to->velocity_mm_s = from->velocity_mm_s;
	v3_copy(to->command_N, from->command_N);
	to->actuated_N = from->actuated_N;
	to->rendered_N = from->rendered_N;
	to->flags = from->flags;
	to->phase = (uint16_t)from->phase;
	to->tool = (uint16_t)from->tool;
}

int incise_state_unpack(struct incise_tick *to, const struct state_tick *from)
{
	if (from->phase > INCISE_PHASE_INSERTION || from->tool > INCISE_TOOL_TUBE)
		return -EIO;
	to->t_ns = from->t_ns;
	v3_copy(to->position_mm, from->position_mm);
	v3_copy(to->tool_mm, from->tool_mm);
	v3_copy(to->proxy_mm, from->proxy_mm);
	v3_copy(to->normal, from->normal);
	for (int i = 0; i < 4; i++)
		to->quaternion[i] = from->quaternion[i];
	to->depth_mm = from->depth_mm;
	to->velocity_mm_s = from->velocity_mm_s;
	v3_copy(to->command_N, from->command_N);
	to->actuated_N = from->actuated_N;
	to->rendered_N = from->rendered_N;
	to->flags = from->flags & ((1u << INCISE_TICK_FLAGS) - 1);
	to->phase = (enum incise_phase)from->phase;
	to->tool = (enum incise_tool)from->tool;
	return 0;
}
