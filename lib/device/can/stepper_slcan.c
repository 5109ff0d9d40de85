// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a stepper that is a CiA 402 drive behind a serial adapter that speaks slcan:
 * "slcan:/dev/ttyACM0:0x10". All it does is in can_stepper.h.
 */
#include <incise/backend.h>
#include "cia402/can_stepper.h"

static void *open_drive(const struct incise_backend_request *request,
			struct incise_error *err)
{
	return can_stepper_open(&can_transport_slcan, request, err);
}

static int scan(const char *arguments, incise_scan_found *found, void *context,
		struct incise_error *err)
{
	return can_stepper_scan(&can_transport_slcan, arguments, found, context, err);
}

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "stepper",
	.name = "slcan",
	.open = open_drive,
	.scan = scan,
};
