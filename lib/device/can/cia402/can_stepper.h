/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stepper that is a CiA 402 drive on a CAN bus, over any transport; see can_bus.h. A thread
 * owns the bus while the drive has power; without power, callers of enable, clear and home
 * borrow it for SDOs.
 */
#ifndef INCISE_CAN_STEPPER_H
#define INCISE_CAN_STEPPER_H

#include "../../motor.h"
#include "can_thread.h"

struct can_stepper {
	struct incise_motor motor;
	struct incise_stepper_ops ops; /* the motor's, some replaced by a drive's */
	const struct incise_stepper_ops *motor_ops;
	/* The two pages. */
	_Alignas(64) struct incise_stepper_setpoint setpoint;
	_Alignas(64) struct incise_abi_status status;
	_Alignas(64) struct can_thread thread;
	/* The thread's, or that of the caller who borrowed it. */
	_Alignas(64) struct can_session session;
};

/* As struct incise_backend.open and .scan, for a backend with this transport. */
void *can_stepper_open(const struct can_transport *transport,
		       const struct incise_backend_request *request,
		       struct incise_error *err);
int can_stepper_scan(const struct can_transport *transport, const char *arguments,
		     incise_scan_found *found, void *context, struct incise_error *err);

#endif
