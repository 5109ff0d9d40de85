/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What an axis watches for in each cycle, and the fault that it makes of it; see axis.h.
 */
#ifndef INCISE_CAN_AXIS_CHECK_H
#define INCISE_CAN_AXIS_CHECK_H

#include "can_axis.h"

/* With power: heartbeat, TPDOs, EMCY, NMT, the bus, other masters. */
void can_axis_check_drive(struct can_axis *axis, int64_t now);

/* E-stop, and limits ahead of it. */
void can_axis_check_inputs(struct can_axis *axis, int64_t now);

/* That it keeps its power, and follows its targets. */
void can_axis_check_running(struct can_axis *axis, int64_t now);

/* What it says is of now. */
bool can_axis_is_fresh(const struct can_axis *axis, int64_t now);

/* Latch a fault, note why, and begin to stop. Nothing without power. */
void can_axis_fault(struct can_axis *axis, uint32_t bits, enum can_axis_why why,
		    int64_t a, int64_t b, int64_t now);

#endif
