// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A simulated haptic device.
 */
#include <errno.h>
#include "sim.h"

struct incise_haptic *incise_sim_haptic_new(const struct incise_backend_request *request,
					    struct incise_error *err)
{
	incise_error_set(err, EOPNOTSUPP, "%s: not there yet", request->where);
	errno = EOPNOTSUPP;
	return NULL;
}
