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

/* Define the backend of a module, which has one transport. */
#define CAN_STEPPER_BACKEND(transport, backend_name)                                    \
	static void *open_drive(const struct incise_backend_request *request,           \
				struct incise_error *err)                               \
	{                                                                               \
		return can_stepper_open(&(transport), request, err);                    \
	}                                                                               \
	static int scan(const char *arguments, incise_scan_found *found, void *context, \
			struct incise_error *err)                                       \
	{                                                                               \
		return can_stepper_scan(&(transport), arguments, found, context, err);  \
	}                                                                               \
	const struct incise_backend incise_backend = {                                  \
		.abi = INCISE_BACKEND_ABI,                                              \
		.kind = "stepper",                                                      \
		.name = (backend_name),                                                 \
		.open = open_drive,                                                     \
		.scan = scan,                                                           \
	}

#endif
