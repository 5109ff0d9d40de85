/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A motor that follows set-points: profile, deadman, latched faults and status, shared by
 * steps on lines and set-points on a bus.
 *
 *   set-points ─▶ listen ─▶ profile ─▶ (steps, or a drive's target)
 *                   │ deadman
 *   faults ─────────┴─▶ brake or halt ─▶ no power ─▶ clear
 *
 * It has no clock and no lines; its owner switches power. For one thread; real-time safe.
 */
#ifndef INCISE_MOTION_H
#define INCISE_MOTION_H

#include <stdbool.h>
#include <stdint.h>
#include "../../driver/uapi/incise_stepper.h"
#include "../fixed/home_edge.h"
#include "../fixed/profile.h"

/* Faults after which it may not brake by its profile, but stops at once. */
#define INCISE_MOTION_AT_ONCE                                              \
	(INCISE_STEPPER_FAULT_LIMIT_MIN | INCISE_STEPPER_FAULT_LIMIT_MAX | \
	 INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_ALARM |         \
	 INCISE_STEPPER_FAULT_LATE | INCISE_STEPPER_FAULT_LINE |           \
	 INCISE_STEPPER_FAULT_BUS | INCISE_STEPPER_FAULT_LOST |            \
	 INCISE_STEPPER_FAULT_FOLLOWING)

struct incise_motion {
	const struct incise_stepper_setpoint *setpoint; /* written by another thread */
	struct incise_stepper_motor_status *slot;	/* read by another thread */

	/* The owner reads them, and writes status.position and .inputs. */
	struct incise_stepper_config config;
	struct incise_stepper_motor_status status; /* copied into the slot */
	struct incise_profile profile;
	bool powered, resting, ending;

	/* private */
	struct incise_stepper_setpoint latest;
	int64_t seen_ns; /* time of the last set-point */
	int64_t ran_ns;	 /* when its owner last ran it */
	uint32_t seq;	 /* of the last set-point */
	struct incise_home_edge edge;
};

/* Without power, at 0. 0, -EINVAL or -ERANGE as of incise_profile_init(). */
int incise_motion_init(struct incise_motion *motion,
		       const struct incise_stepper_config *config);

/* Copy the status into the slot. */
void incise_motion_publish(struct incise_motion *motion, int64_t now_ns);

/*
 * Power it, at rest at status.position; the deadman runs from @now_ns on. 1: the owner
 * switches power on; 0: it was on; -EPERM: a fault is latched; -EBUSY: an input forbids
 * it, or it is coming to rest.
 */
int incise_motion_power_on(struct incise_motion *motion, int64_t now_ns);

/* The owner has switched power off. */
void incise_motion_power_off(struct incise_motion *motion);

/* Stop at status.position without a target. @moved: it is no longer homed. */
void incise_motion_halt(struct incise_motion *motion, bool moved);

/*
 * Come to rest within the limits; once `ending` and `resting`, power is to be switched
 * off.
 */
void incise_motion_brake(struct incise_motion *motion, uint32_t fault);

/*
 * Latch a fault (0: no fault) of a powered motor, and brake. True: it is of
 * INCISE_MOTION_AT_ONCE, and the owner switches power off now.
 */
bool incise_motion_fault(struct incise_motion *motion, uint32_t fault);

/*
 * Each time its owner runs it, before anything else. 0, or the deadman's fault if with power
 * the owner itself stood still for longer than that, as a program that is stopped: the motor
 * has left the profile, and a set-point that comes now comes too late.
 */
uint32_t incise_motion_awake(struct incise_motion *motion, int64_t now_ns);

/* Read a new set-point. 0, or the fault of an invalid or a missing one. */
uint32_t incise_motion_listen(struct incise_motion *motion, int64_t now_ns);

/*
 * Compare the place of the home edge with that at homing. @passed: its input just became active, in
 * @direction, +1 or -1. 0, or the fault of lost steps.
 */
uint32_t incise_motion_compare(struct incise_motion *motion, bool passed,
			       int32_t direction);

/* Update `resting` and the state after a tick of the profile. */
void incise_motion_ticked(struct incise_motion *motion);

/* As the ioctls CLEAR and SET_POSITION. */
int incise_motion_clear(struct incise_motion *motion);
int incise_motion_origin(struct incise_motion *motion, int32_t steps, bool homed);

#endif
