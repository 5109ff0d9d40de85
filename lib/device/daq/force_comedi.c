// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a force channel on a DAQ card under comedi: "comedi:/dev/comedi0:0". All it
 * does is in comedi_force.h.
 */
#include "comedi_force.h"

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "force",
	.name = "comedi",
	.open = comedi_force_open,
	.scan = comedi_force_scan,
};
