// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a tracker of Polhemus on USB: "usb:0f44:0002", "usb:0f44:0002@1-1.2",
 * "usb:0f44:0002#SERIAL".
 */
#include "polhemus_tracker.h"
#include "polhemus_usb.h"
#include "polhemus_usb_find.h"

static void *open_tracker(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	struct polhemus_line *line =
		polhemus_usb_open(request->arguments, request->where, err);

	return line ? polhemus_tracker_open(line, request->tracker, &POLHEMUS_TIMES,
					    request->where, err)
		    : NULL;
}

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "tracker",
	.name = "usb",
	.open = open_tracker,
	.scan = polhemus_usb_scan,
};
