// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What an axis watches for; see axis_check.h.
 */
#include "can_axis_check.h"

#define MS 1000000LL
#define INPUTS_NS (3 * CIA402_INPUTS_MS * MS)
#define OPEN_CYCLES 10	  /* without an answer, in csv and cst … */
#define OPEN_NS (20 * MS) /* … and at least that */

bool can_axis_is_fresh(const struct can_axis *axis, int64_t now)
{
	return now - axis->tpdo_ns <= 3 * (int64_t)axis->setup.config.tick_ns;
}

/* What it says of itself, beside its position. */
void can_axis_check_drive(struct can_axis *axis, int64_t now)
{
	const struct canopen *master = axis->master;
	enum cia402_state state = cia402_state(axis->statusword);

	if (master->bus_offs != axis->bus_offs)
		can_axis_fault(axis, INCISE_ABI_FAULT_BUS, CAN_AXIS_BUS_OFF, 0, 0, now);
	if (master->boots != axis->boots)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_REBOOTED, 0, 0, now);
	if (master->emcy.count != axis->emcys)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_EMCY,
			       master->emcy.code, master->emcy.error_register, now);
	/* Its EMCY may be a frame behind: the next cycle has it. */
	else if (state == CIA402_FAULT || state == CIA402_FAULT_REACTION) {
		if (axis->failed)
			can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER,
				       CAN_AXIS_DRIVE_FAULT, 0, 0, now);
		axis->failed = true;
	}
	if (master->foreign != axis->foreign)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_SETPOINT, CAN_AXIS_FOREIGN, 0,
			       0, now);
	if (now - master->last_heartbeat_ns > axis->setup.silence_ns)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_NO_HEARTBEAT,
			       axis->setup.silence_ns / MS, 0, now);
	else if (master->state != CANOPEN_OPERATIONAL)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_NMT, master->state,
			       0, now);
	if (axis->setup.inputs_timed && axis->inputs_ns > INPUTS_NS)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_NO_INPUTS,
			       INPUTS_NS / MS, 0, now);
	/* Where the loop is closed here, it cannot stay open for so long. */
	if (axis->setup.mode != CIA402_CSP && axis->missed >= OPEN_CYCLES &&
	    now - axis->tpdo_ns > OPEN_NS)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_NO_TPDO,
			       OPEN_NS / MS, 0, now);
	if (now - axis->tpdo_ns > axis->setup.silence_ns)
		can_axis_fault(axis, INCISE_ABI_FAULT_LOST, CAN_AXIS_NO_TPDO,
			       axis->setup.silence_ns / MS, 0, now);
}

void can_axis_check_inputs(struct can_axis *axis, int64_t now)
{
	uint32_t inputs = axis->motion.status.inputs;
	int64_t velocity = incise_profile_velocity(&axis->motion.profile);

	if (inputs & INCISE_STEPPER_LINE_ESTOP)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_ESTOP, CAN_AXIS_NO_REASON, 0, 0,
			       now);
	if (axis->phase != CAN_AXIS_RUNNING)
		return;
	/* Away from a limit it may go. */
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MIN && velocity < 0)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_LIMIT_MIN, CAN_AXIS_NO_REASON,
			       0, 0, now);
	if (inputs & INCISE_STEPPER_LINE_LIMIT_MAX && velocity > 0)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_LIMIT_MAX, CAN_AXIS_NO_REASON,
			       0, 0, now);
}

/* It is somewhere behind: between the targets that it may have had by now. */
static void check_following(struct can_axis *axis, int64_t now)
{
	int64_t at = axis->motion.status.position, low = INT64_MAX, high = INT64_MIN, off;

	for (int i = 0; i < 4; i++) {
		low = axis->commanded[i] < low ? axis->commanded[i] : low;
		high = axis->commanded[i] > high ? axis->commanded[i] : high;
	}
	off = at < low ? low - at : at > high ? at - high : 0;
	if (off <= axis->setup.following) {
		axis->off_ns = 0;
		return;
	}
	if (!axis->off_ns)
		axis->off_ns = now;
	if (now - axis->off_ns >= axis->setup.following_ns)
		can_axis_fault(axis, INCISE_ABI_FAULT_FOLLOWING, CAN_AXIS_OFF_TARGET, off,
			       0, now);
}

void can_axis_check_running(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);

	if (state == CIA402_FAULT || state == CIA402_FAULT_REACTION)
		return;
	if (state != CIA402_ENABLED)
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_NOT_ENABLED,
			       state, 0, now);
	/* Where it was when it last spoke is not where it is. */
	else if (axis->phase == CAN_AXIS_RUNNING && can_axis_is_fresh(axis, now))
		check_following(axis, now);
}
