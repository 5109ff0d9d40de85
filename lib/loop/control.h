/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The loop's side of its control; see incise/loop_control.h. All of it is real-time safe and
 * for the loop's thread alone.
 */
#ifndef INCISE_LOOP_CONTROL_INTERNAL_H
#define INCISE_LOOP_CONTROL_INTERNAL_H

#include <incise/loop_control.h>

/* What waits to be run, and stays there; NULL for none. */
struct incise_plan *incise_loop_control_waiting(const struct incise_loop_control *control)
	INCISE_REALTIME;

/*
 * Take what waits in the place of @old, which is given back. NULL, and nothing is done, when
 * it was withdrawn meanwhile.
 */
struct incise_plan *incise_loop_control_swap(struct incise_loop_control *control,
					     struct incise_plan *old) INCISE_REALTIME;

void incise_loop_control_event(struct incise_loop_control *control,
			       const struct incise_loop_event *event) INCISE_REALTIME;

void incise_loop_control_ticked(struct incise_loop_control *control,
				uint64_t ticks) INCISE_REALTIME;

#endif
