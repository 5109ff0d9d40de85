/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a cycle of an axis is made of; see axis.h.
 *
 *   can_axis_hear() ─▶ what the phase does ─▶ can_axis_put() ─▶ can_axis_sync()
 */
#ifndef INCISE_CAN_AXIS_CYCLE_H
#define INCISE_CAN_AXIS_CYCLE_H

#include "can_axis_check.h"

/* All that came since the last cycle. */
void can_axis_hear(struct can_axis *axis, int64_t now);

/* Send a set-point; axis->put says whether it went out. */
void can_axis_put(struct can_axis *axis, uint16_t controlword, int32_t target,
		  int64_t now);

void can_axis_sync(struct can_axis *axis, int64_t now);

/* A target that moves nothing, in the drive's units, whatever its mode asks for. */
int32_t can_axis_hold_target(const struct can_axis *axis);

/* The profile's next point, likewise. */
int32_t can_axis_next_target(struct can_axis *axis);

/* Its first target lies within the limits: that must be no jump. */
bool can_axis_within(const struct can_axis *axis);

/* The first reason stays: the others follow from it. */
void can_axis_note(struct can_axis *axis, enum can_axis_why why, int64_t a, int64_t b);

void can_axis_enter(struct can_axis *axis, enum can_axis_phase phase, int64_t now);

/* What each phase does in a cycle. */
void can_axis_idle(struct can_axis *axis);
void can_axis_start(struct can_axis *axis, int64_t now);
void can_axis_run(struct can_axis *axis, int64_t now);
void can_axis_home(struct can_axis *axis, int64_t now);
void can_axis_end(struct can_axis *axis, int64_t now);
void can_axis_quick_stop(struct can_axis *axis, int64_t now);

#endif
