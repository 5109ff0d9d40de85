/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The same in each backend of a haptic device: how it is opened and ends, and the largest force.
 */
#ifndef INCISE_RIG_HAPTIC_BACKEND_H
#define INCISE_RIG_HAPTIC_BACKEND_H

#include <incise/backend.h>

/* Return @haptic from open(), or after an error @rc close it: NULL with errno. */
void *incise_haptic_opened(struct incise_haptic *haptic, int rc);

/* End a device for good; the first end remains. Returns its error. */
int incise_haptic_end(struct incise_haptic *haptic, int error, const char *format, ...)
	INCISE_PRINTF(3, 4);

/* A share of a force, or a torque, of at most @most; 0 or NaN, it is not known: nothing is given. */
void incise_haptic_limit(double to[3], const double from[3], double share,
			 double most) INCISE_REALTIME;

#endif
