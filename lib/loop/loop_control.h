/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The loop's side of its control; see incise/loop_control.h. Real-time safe, for the loop's
 * thread alone.
 */
#ifndef INCISE_LOOP_CONTROL_INTERNAL_H
#define INCISE_LOOP_CONTROL_INTERNAL_H

#include <incise/loop_control.h>

/* Whether a plan waits, which stays there, and the place of the retired one is free. */
bool incise_loop_control_waiting(const struct incise_loop_control *control)
	INCISE_REALTIME;

/* Take the waiting plan: it is the loop's from now on. NULL if it was withdrawn meanwhile. */
struct incise_plan *incise_loop_control_next(struct incise_loop_control *control)
	INCISE_REALTIME;

/* Hand the replaced plan back; others may free it from now on. */
void incise_loop_control_retire(struct incise_loop_control *control,
				struct incise_plan *old) INCISE_REALTIME;

void incise_loop_control_event(struct incise_loop_control *control,
			       const struct incise_loop_event *event) INCISE_REALTIME;

/* Events that were dropped because the ring was full. Any thread's. */
uint64_t incise_loop_control_events_lost(const struct incise_loop_control *control);

void incise_loop_control_ticked(struct incise_loop_control *control, uint64_t ticks,
				enum incise_tool tool) INCISE_REALTIME;

/* The tool that was set; false: not set. */
bool incise_loop_control_wanted_tool(const struct incise_loop_control *control,
				     enum incise_tool *tool) INCISE_REALTIME;

/* Keep a tick, where incise_loop_control_keep() has made room. */
void incise_loop_control_tick(struct incise_loop_control *control,
			      const struct incise_tick *tick) INCISE_REALTIME;

#endif
