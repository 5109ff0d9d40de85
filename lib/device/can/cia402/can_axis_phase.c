// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The phases of an axis, from power to no power; drawn in axis.h.
 *
 * A part of one noun: tests/unit/can/can_axis.c tests it through its door.
 */
#include <errno.h>
#include "can_axis_cycle.h"

#define MS 1000000LL
#define START_NS (500 * MS)    /* from no power to operation enabled */
#define END_NS (200 * MS)      /* from shutdown to no power */
#define QUICK_NS (1000 * MS)   /* a quick stop beside that */
#define PICKED_UP_NS (50 * MS) /* a drive has taken the start of homing by then */

void can_axis_enter(struct can_axis *axis, enum can_axis_phase phase, int64_t now)
{
	axis->phase = phase;
	axis->since_ns = now;
	axis->told = false;
	axis->answers = 0;
}

static void power_off(struct can_axis *axis, int64_t now)
{
	struct incise_motion *m = &axis->motion;

	incise_motion_halt(m, m->status.faults & INCISE_ABI_FAULT_LOST);
	incise_motion_power_off(m);
	if (axis->result > 0)
		axis->result = axis->outcome;
	can_axis_enter(axis, CAN_AXIS_IDLE, now);
}

/*
 * What the drive says now answers to what it was told in this phase: the SYNC of that cycle
 * may have sampled it before, the one after that not.
 */
static bool has_answered(const struct can_axis *axis)
{
	return axis->told && axis->answers >= 2;
}

/* Nobody gave it power, and yet it says that it has it. */
void can_axis_idle(struct can_axis *axis)
{
	struct incise_abi_status *status = &axis->motion.status;

	if (!axis->came || axis->answers < 2 ||
	    cia402_state(axis->statusword) != CIA402_ENABLED)
		return;
	if (!status->faults)
		can_axis_note(axis, CAN_AXIS_NO_STOP, CIA402_ENABLED, 0);
	status->faults |= INCISE_STEPPER_FAULT_DRIVER;
	status->state = INCISE_STEPPER_STATE_FAULT;
	axis->mute = true;
}

void can_axis_start(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool homes = axis->limit_ns, fresh = axis->tpdo_ns != axis->since_ns;

	can_axis_check_inputs(axis, now);
	if (axis->phase != CAN_AXIS_STARTING)
		return;

	if (fresh && state == CIA402_ENABLED && !homes && !can_axis_within(axis)) {
		/* It gave way, so far that its first target would be a jump. */
		can_axis_note(axis, CAN_AXIS_OUTSIDE, axis->motion.status.position, 0);
		axis->outcome = -ERANGE;
		axis->motion.ending = true;
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, now);
	} else if (fresh && state == CIA402_ENABLED) {
		axis->motion.seen_ns = now;
		/* It may have given way a little while it got power. */
		incise_motion_halt(&axis->motion, false);
		for (int i = 0; i < 4; i++)
			axis->commanded[i] =
				incise_profile_position(&axis->motion.profile);
		axis->motion.status.state =
			homes ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY;
		axis->old_bits =
			axis->statusword & (CIA402_HOMED | CIA402_FOLLOWING_ERROR);
		if (!homes)
			axis->result = 0;
		can_axis_enter(axis, homes ? CAN_AXIS_HOMING : CAN_AXIS_RUNNING, now);
	} else if (now - axis->since_ns > START_NS) {
		can_axis_note(axis, CAN_AXIS_NO_START, state, 0);
		axis->outcome = -ETIMEDOUT;
		axis->motion.ending = true;
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, now);
	}
	/* What it said before may be old: no target is made of that. */
	if (!fresh)
		axis->put = true;
	else if (axis->phase != CAN_AXIS_QUICK_STOP)
		can_axis_put(axis, cia402_up(state), can_axis_hold_target(axis), now);
}

void can_axis_run(struct can_axis *axis, int64_t now)
{
	struct incise_motion *m = &axis->motion;
	uint32_t bits = incise_motion_listen(m, now);

	if (bits)
		can_axis_fault(axis, bits, CAN_AXIS_NO_REASON, 0, 0, now);
	can_axis_check_inputs(axis, now);
	if (m->ending && m->resting && axis->phase == CAN_AXIS_RUNNING)
		can_axis_enter(axis, CAN_AXIS_ENDING, now);
	if (axis->phase == CAN_AXIS_RUNNING)
		can_axis_put(axis, CIA402_ENABLE, can_axis_next_target(axis), now);
}

void can_axis_home(struct can_axis *axis, int64_t now)
{
	uint16_t word = axis->statusword;
	bool begun = !axis->old_bits || now - axis->since_ns > PICKED_UP_NS;

	can_axis_check_inputs(axis, now);
	if (axis->phase != CAN_AXIS_HOMING)
		return;
	/* What a homing before left is over when the drive takes this one up. */
	axis->old_bits &= word;
	if (axis->stop_homing) {
		axis->outcome = -EINTR;
		axis->motion.ending = true;
		axis->motion.status.state = INCISE_STEPPER_STATE_STOPPING;
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, now);
	} else if (begun && word & CIA402_FOLLOWING_ERROR) {
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_NO_HOME, 0, 0,
			       now);
	} else if (now > axis->limit_ns) {
		axis->outcome = -ETIMEDOUT;
		can_axis_fault(axis, INCISE_STEPPER_FAULT_DRIVER, CAN_AXIS_HOME_TIME, 0,
			       0, now);
	} else if (begun && word & CIA402_HOMED && word & CIA402_TARGET_REACHED) {
		axis->outcome = 0;
		axis->motion.ending = true;
		can_axis_enter(axis, CAN_AXIS_ENDING, now);
	} else {
		can_axis_put(axis, CIA402_HOME_START, 0, now);
	}
}

/* It rests: power away without a stop. */
void can_axis_end(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);

	if (!cia402_powered(state) && has_answered(axis)) {
		can_axis_put(axis, CIA402_DISABLE_VOLTAGE, can_axis_hold_target(axis),
			     now);
		power_off(axis, now);
		return;
	}
	if (now - axis->since_ns > END_NS) {
		can_axis_enter(axis, CAN_AXIS_QUICK_STOP, now);
		return;
	}
	can_axis_put(axis, CIA402_SHUTDOWN, can_axis_hold_target(axis), now);
	axis->told |= axis->put;
}

/* By the drive's own ramp, then without power; or as well as can be known. */
void can_axis_quick_stop(struct can_axis *axis, int64_t now)
{
	enum cia402_state state = cia402_state(axis->statusword);
	bool stopping = state == CIA402_ENABLED || state == CIA402_QUICK_STOP ||
			state == CIA402_FAULT_REACTION;
	int64_t most = QUICK_NS + (int64_t)axis->setup.config.deadman_ns +
		       (int64_t)(1e9 * axis->setup.config.velocity /
				 axis->setup.config.acceleration);

	if (can_axis_is_fresh(axis, now) && !cia402_powered(state) &&
	    has_answered(axis)) {
		can_axis_put(axis, CIA402_DISABLE_VOLTAGE, can_axis_hold_target(axis),
			     now);
		power_off(axis, now);
		return;
	}
	/*
	 * Past that time it is either off the bus, and stops by its own deadman, or does not
	 * obey: nothing more can be done from here than to say it.
	 */
	if (now - axis->since_ns > most) {
		can_axis_put(axis, CIA402_DISABLE_VOLTAGE, can_axis_hold_target(axis),
			     now);
		if (!axis->motion.status.faults && axis->outcome != -ETIMEDOUT)
			axis->motion.status.faults |= INCISE_ABI_FAULT_LOST;
		can_axis_note(axis, CAN_AXIS_NO_STOP, state, 0);
		axis->mute = true;
		power_off(axis, now);
		return;
	}
	can_axis_put(axis, stopping ? CIA402_QUICK_STOP_COMMAND : CIA402_DISABLE_VOLTAGE,
		     can_axis_hold_target(axis), now);
	axis->told |= axis->put;
}
