/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stepper that is a CiA 402 drive on a CAN bus, over any transport; see can_bus.h. A
 * thread of its own owns the bus while the drive has power; without power, callers of
 * enable, clear and home borrow it for SDOs.
 */
#ifndef INCISE_CAN_STEPPER_H
#define INCISE_CAN_STEPPER_H

#include "../../motor.h"
#include "can_thread.h"

struct can_stepper {
	struct incise_motor motor;
	struct incise_stepper_ops ops; /* the motor's, and a drive's own */
	const struct incise_stepper_ops *motor_ops;
	/* The two pages. */
	_Alignas(64) struct incise_stepper_setpoint setpoint;
	_Alignas(64) struct incise_abi_status status;
	_Alignas(64) struct can_thread thread;
	/* The thread's, or the caller's who borrowed it. */
	_Alignas(64) struct can_link link;
};

/* Give power, in its mode or for at most so long in homing mode; returns when it has it, or
 * has homed. @what begins the line. 0 or -errno. */
int can_stepper_power(struct can_stepper *c, int64_t homing_ns, const volatile int *stop,
		      const char *what, struct incise_error *err);

/* Why it has no power, in a line; @rc where nothing is known of that. */
int can_stepper_say_why(struct can_stepper *c, int rc, const char *what,
			struct incise_error *err);

enum incise_stepper_state can_stepper_state(struct can_stepper *c);

/* struct incise_stepper_ops.home */
int can_stepper_home(struct incise_stepper *stepper, const volatile int *stop,
		     struct incise_stepper_edge_found *edge, struct incise_error *err);

/* As struct incise_backend.open and .scan, of a backend with this transport. */
void *can_stepper_open(const struct can_transport *transport,
		       const struct incise_backend_request *request,
		       struct incise_error *err);
int can_stepper_scan(const struct can_transport *transport, const char *arguments,
		     incise_scan_found *found, void *context, struct incise_error *err);

#endif
