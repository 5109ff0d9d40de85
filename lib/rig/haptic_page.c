// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The user's end of a haptic device that another process owns; see incise/haptic_page.h.
 */
#include <errno.h>
#include "haptic_page.h"

struct incise_haptic *incise_haptic_attach(const char *spec, const char *device,
					   const char *where,
					   const struct incise_haptic_setup *setup,
					   struct incise_clock *clock,
					   struct incise_error *err)
{
	(void)spec;
	(void)device;
	(void)setup;
	(void)clock;
	incise_error_set(err, EOPNOTSUPP, "%s: not there yet", where);
	errno = EOPNOTSUPP;
	return NULL;
}
