/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stepper that is a CiA 402 drive on a CAN bus, over any transport; see can_bus.h.
 */
#ifndef INCISE_CAN_STEPPER_H
#define INCISE_CAN_STEPPER_H

#include <incise/backend.h>
#include "../bus/can_bus.h"

/* As struct incise_backend.open and .scan, for a backend with this transport. */
void *can_stepper_open(const struct can_transport *transport,
		       const struct incise_backend_request *request,
		       struct incise_error *err);
int can_stepper_scan(const struct can_transport *transport, const char *arguments,
		     incise_scan_found *found, void *context, struct incise_error *err);

#endif
