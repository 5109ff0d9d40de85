/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * States, faults and lines of a stepper: names and values for the library, its backends and
 * the kernel module. The values are ABI of /dev/incise-stepperN; see
 * driver/uapi/incise_stepper.h.
 */
#ifndef INCISE_STEPPER_STATE_H
#define INCISE_STEPPER_STATE_H

/** States of a stepper. */
enum incise_stepper_state {
	INCISE_STEPPER_STATE_DISABLED = 0, /**< not powered, no fault latched */
	INCISE_STEPPER_STATE_READY = 1,	   /**< powered, at rest */
	INCISE_STEPPER_STATE_MOVING = 2,
	INCISE_STEPPER_STATE_STOPPING = 3, /**< decelerating after a fault or disable */
	INCISE_STEPPER_STATE_FAULT = 4, /**< not powered, fault latched: clear, enable */
};

/**
 * Faults; bits. All are latched except TRAVEL, and DEADMAN on the simulated rig, which ends
 * with the next target. The kernel module has those up to LINE, PLAN and STEPS.
 */
enum incise_stepper_fault {
	INCISE_STEPPER_FAULT_DEADMAN = 1 << 0, /**< no new target for the deadman time */
	INCISE_STEPPER_FAULT_LIMIT_MIN =
		1 << 1, /**< a step towards the active limit at 0 */
	INCISE_STEPPER_FAULT_LIMIT_MAX = 1 << 2, /**< … at the end of the travel */
	INCISE_STEPPER_FAULT_ESTOP = 1 << 3, /**< the emergency stop is or was active */
	INCISE_STEPPER_FAULT_ALARM = 1 << 4, /**< fault output of the power stage */
	INCISE_STEPPER_FAULT_LATE = 1 << 5,  /**< the timer was late too often */
	INCISE_STEPPER_FAULT_SETPOINT = 1 << 6, /**< an invalid setpoint */
	INCISE_STEPPER_FAULT_OWNER = 1
				     << 7, /**< its program ended while it was enabled */
	INCISE_STEPPER_FAULT_SUSPEND = 1 << 8, /**< the machine was suspended */
	INCISE_STEPPER_FAULT_GONE = 1 << 9,    /**< the device was unbound or unplugged */
	INCISE_STEPPER_FAULT_LINE = 1 << 10,   /**< error at a GPIO line */
	INCISE_STEPPER_FAULT_BUS = 1 << 11,    /**< the bus to the drive fails */
	INCISE_STEPPER_FAULT_LOST = 1
				    << 12, /**< the drive does not answer, or restarted */
	INCISE_STEPPER_FAULT_FOLLOWING = 1 << 13, /**< does not follow its targets */
	INCISE_STEPPER_FAULT_TRAVEL = 1 << 14, /**< target outside the travel, clamped */
	INCISE_STEPPER_FAULT_PLAN = 1 << 15, /**< another motor of its plan was stopped */
	INCISE_STEPPER_FAULT_STEPS = 1 << 16, /**< steps were lost */
};
#define INCISE_STEPPER_FAULTS 17 /**< bits of incise_stepper_fault */

/** Lines; bits. The inputs come first. */
enum incise_stepper_line {
	INCISE_STEPPER_LINE_LIMIT_MIN = 1 << 0,
	INCISE_STEPPER_LINE_LIMIT_MAX = 1 << 1,
	INCISE_STEPPER_LINE_HOME = 1 << 2,
	INCISE_STEPPER_LINE_ESTOP = 1 << 3,
	INCISE_STEPPER_LINE_ALARM = 1 << 4,
	INCISE_STEPPER_LINE_ENABLE = 1 << 5, /**< an output; only in info of the module */
	INCISE_STEPPER_LINE_DIR = 1 << 6,    /**< an output; only in info of the module */
};
#define INCISE_STEPPER_INPUTS 5 /**< bits of incise_stepper_line that are inputs */

/** States of a plan. */
enum incise_stepper_plan_state {
	INCISE_STEPPER_PLAN_EMPTY = 0,	/**< no plan */
	INCISE_STEPPER_PLAN_LOADED = 1, /**< its motors are off, or follow no pose */
	INCISE_STEPPER_PLAN_WAIT = 2,	/**< no force until the tool leaves the tissue */
	INCISE_STEPPER_PLAN_RISE = 3,	/**< the force ramps up */
	INCISE_STEPPER_PLAN_FELT = 4,	/**< full force */
	INCISE_STEPPER_PLAN_FADE = 5,	/**< the force ramps to 0, or is 0 */
};
#define INCISE_STEPPER_PLAN_STATES 6 /**< states of a plan */

/** Reasons why a plan ramps or ramped its force to 0; bits, latched. */
enum incise_stepper_plan_reason {
	INCISE_STEPPER_PLAN_SILENT = 1 << 0,  /**< no pose within the plan's pose age */
	INCISE_STEPPER_PLAN_ASKED = 1 << 1,   /**< requested with a pose */
	INCISE_STEPPER_PLAN_LEFT = 1 << 2,    /**< its program ended */
	INCISE_STEPPER_PLAN_AWAY = 1 << 3,    /**< suspend, unbind or reboot */
	INCISE_STEPPER_PLAN_STOPPED = 1 << 4, /**< a fault of one of its motors */
	INCISE_STEPPER_PLAN_REFUSED = 1 << 5, /**< poses were rejected */
};
#define INCISE_STEPPER_PLAN_REASONS 6 /**< bits of incise_stepper_plan_reason */

#endif
