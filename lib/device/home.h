/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Finding the machine's 0; see incise_stepper_home().
 */
#ifndef INCISE_HOME_H
#define INCISE_HOME_H

#include <incise/backend.h>

/* For a stepper with jog, homing, edge and origin; @edge may be NULL. */
int incise_home(struct incise_stepper *stepper, const volatile int *stop,
		struct incise_stepper_edge_found *edge, struct incise_error *err);

#endif
