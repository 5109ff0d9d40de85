/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A motor that follows set-points, whatever makes it move: its profile, deadman, faults
 * that stay, and status. Steps on lines and set-points on a bus have this in common.
 *
 *   set-points ─▶ listen ─▶ profile ─▶ (steps, or a drive's target)
 *                   │ deadman
 *   faults ─────────┴─▶ brake or halt ─▶ no power ─▶ clear
 *
 * It knows no clock and no lines; who owns it takes power away when told. One thread. All
 * is real-time safe.
 */
#ifndef INCISE_MOTION_H
#define INCISE_MOTION_H

#include <stdbool.h>
#include <stdint.h>
#include "../fixed/profile.h"
#include "abi.h"

/* After these it may not take the time to brake by its profile. */
#define INCISE_MOTION_AT_ONCE                                                           \
	(INCISE_STEPPER_FAULT_LIMIT_MIN | INCISE_STEPPER_FAULT_LIMIT_MAX |              \
	 INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_DRIVER |                     \
	 INCISE_STEPPER_FAULT_LATE | INCISE_STEPPER_FAULT_LINE | INCISE_ABI_FAULT_BUS | \
	 INCISE_ABI_FAULT_LOST | INCISE_ABI_FAULT_FOLLOWING)

struct incise_motion {
	const struct incise_stepper_setpoint *setpoint; /* another thread's to write */
	struct incise_abi_status *slot;			/* another thread's to read */

	/* For its owner to read; status.position and .inputs are its to write. */
	struct incise_stepper_config config;
	struct incise_abi_status status; /* what goes into the slot */
	struct incise_profile profile;
	bool powered, resting, ending;

	/* private */
	struct incise_stepper_setpoint wish;
	int64_t seen_ns; /* the last sign of life */
	uint32_t seq;	 /* of the last set-point */
};

/* Without power at 0. Returns 0, -EINVAL, -ERANGE as incise_profile_init() says. */
int incise_motion_init(struct incise_motion *motion,
		       const struct incise_stepper_config *config);

/* Give the status to who reads it. */
void incise_motion_publish(struct incise_motion *motion, int64_t now_ns);

/*
 * Power it, at rest at status.position; the deadman runs from @now_ns on. Returns 1 (now
 * the owner gives it power), 0 (it had it), -EPERM (a fault is latched), -EBUSY (an input
 * forbids it, or it is coming to rest).
 */
int incise_motion_power_on(struct incise_motion *motion, int64_t now_ns);

/* It has no power any more. */
void incise_motion_power_off(struct incise_motion *motion);

/* It stands, where status.position says, with nothing left to do. @moved: not homed now. */
void incise_motion_halt(struct incise_motion *motion, bool moved);

/* Come to rest within the limits, then `ending` and at rest: power is to be taken away. */
void incise_motion_brake(struct incise_motion *motion, uint32_t fault);

/*
 * Latch a fault (0: none) of a motor with power, and brake. True: of INCISE_MOTION_AT_ONCE; the owner
 * takes power away now.
 */
bool incise_motion_fault(struct incise_motion *motion, uint32_t fault);

/* Take a new set-point. Returns a fault that came by it, or by none, or 0. */
uint32_t incise_motion_listen(struct incise_motion *motion, int64_t now_ns);

/* After a tick of the profile: whether it rests, and the state that follows. */
void incise_motion_ticked(struct incise_motion *motion);

/* As the ioctls of the same names. */
int incise_motion_clear(struct incise_motion *motion);
int incise_motion_origin(struct incise_motion *motion, int32_t steps, bool homed);

#endif
