// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a force channel on an A/D converter of Linux IIO: "iio:NAME". All it does
 * is in iio_force.h.
 */
#include "iio_force.h"

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "force",
	.name = "iio",
	.open = iio_force_open,
	.scan = iio_force_scan,
};
