// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Why an axis stopped, in words that say what to do; see axis.h.
 */
#include <stdio.h>
#include <string.h>
#include "can_axis.h"

int can_axis_why(const struct can_axis *axis, char *text, size_t size)
{
	long long a = axis->why_a, b = axis->why_b;
	char words[120];

	switch ((enum can_axis_why)axis->why) {
	case CAN_AXIS_NO_REASON:
		return 0;
	case CAN_AXIS_EMCY:
		return snprintf(text, size,
				"its emergency message says %s, error register %02llxh; "
				"see to that, then clear",
				canopen_emcy_text((uint16_t)a, words, sizeof(words)), b);
	case CAN_AXIS_DRIVE_FAULT:
		return snprintf(text, size,
				"it is in fault and does not say why: see its own "
				"indicators, then clear");
	case CAN_AXIS_NOT_ENABLED:
		return snprintf(text, size,
				"it left operation enabled by itself and is in %s: see "
				"its enable and safe-torque-off inputs, then clear",
				cia402_state_name((enum cia402_state)a));
	case CAN_AXIS_NO_HEARTBEAT:
		return snprintf(
			text, size,
			"no heartbeat of it for %lld ms: see its power and cable, "
			"then clear",
			a);
	case CAN_AXIS_NO_TPDO:
		return snprintf(text, size,
				"no status (TPDO1) of it for %lld ms: see its power and "
				"cable, then clear",
				a);
	case CAN_AXIS_NO_INPUTS:
		return snprintf(
			text, size,
			"its inputs (TPDO2) were not heard for %lld ms, the e-stop "
			"among them: see what changed its set-up, then clear",
			a);
	case CAN_AXIS_REBOOTED:
		return snprintf(text, size,
				"it began anew (boot-up message): see its power supply, "
				"then clear, enable and home");
	case CAN_AXIS_NMT:
		return snprintf(text, size,
				"another master or its own fault put it to %s: end that, "
				"then clear",
				canopen_state_name((enum canopen_state)a));
	case CAN_AXIS_BUS_OFF:
		return snprintf(
			text, size,
			"the bus is off after too many errors: see cable, ends and "
			"bit rate, then clear");
	case CAN_AXIS_QUEUE_FULL:
		return snprintf(text, size,
				"the bus took no set-point for %lld cycles, its queue is "
				"full: see that somebody acknowledges frames, then clear",
				a);
	case CAN_AXIS_BUS_FAILED:
		return snprintf(text, size,
				"the bus fails: %s; see `ip -details link show`, or plug "
				"the adapter in, then clear",
				strerror((int)a));
	case CAN_AXIS_FOREIGN:
		return snprintf(text, size,
				"another program sends set-points or SYNCs on this bus: "
				"end it, then clear");
	case CAN_AXIS_OFF_TARGET:
		return snprintf(text, size,
				"it was off its target by %.3g mm for longer than "
				"following_ms: see what blocks it, or give a smaller "
				"acceleration_mm_s2, then clear",
				(double)a * axis->setup.step_mm);
	case CAN_AXIS_NO_START:
		return snprintf(text, size,
				"it did not come to operation enabled, and stays in %s: "
				"see its supply, enable and safe-torque-off inputs",
				cia402_state_name((enum cia402_state)a));
	case CAN_AXIS_NO_HOME:
		return snprintf(
			text, size,
			"its homing failed: see its switches and homing_method in "
			"rig.conf, then clear");
	case CAN_AXIS_HOME_TIME:
		return snprintf(text, size,
				"its homing was not done in time: see that it moves, "
				"home_mm_s and homing_method in rig.conf, then clear");
	case CAN_AXIS_OUTSIDE:
		return snprintf(
			text, size,
			"it gave way while it got power, to %.3f mm, outside of its "
			"travel: see its brake, and home it",
			(double)a * axis->setup.step_mm);
	case CAN_AXIS_NO_STOP:
		return snprintf(text, size,
				"it did not say that it stopped, and was last in %s: "
				"switch its power off",
				cia402_state_name((enum cia402_state)a));
	}
	return 0;
}
