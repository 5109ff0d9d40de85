// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Faults of an axis, and what it does then; see axis_check.h.
 *
 * A part of one noun: tests/unit/can/can_axis.c tests it through its door.
 */
#include "can_axis_cycle.h"

void can_axis_note(struct can_axis *axis, enum can_axis_why why, int64_t a, int64_t b)
{
	if (axis->why != CAN_AXIS_NO_REASON)
		return;
	axis->why_a = a;
	axis->why_b = b;
	axis->why = why;
}

void can_axis_fault(struct can_axis *axis, uint32_t bits, enum can_axis_why why,
		    int64_t a, int64_t b, int64_t now)
{
	struct incise_motion *m = &axis->motion;

	if (!m->powered)
		return;
	if (!m->status.faults)
		can_axis_note(axis, why, a, b);
	if (axis->phase == CAN_AXIS_QUICK_STOP) {
		m->status.faults |= bits;
		return;
	}
	/*
	 * There is no profile to brake by yet, or none at all; and amid another's set-points
	 * ours are none.
	 */
	if (incise_motion_fault(m, bits) || why == CAN_AXIS_FOREIGN ||
	    axis->phase == CAN_AXIS_STARTING || axis->phase == CAN_AXIS_HOMING) {
		m->ending = true;
		m->status.state = INCISE_STEPPER_STATE_STOPPING;
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, now);
	}
}
