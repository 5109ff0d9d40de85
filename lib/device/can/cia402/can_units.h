/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What rig.conf says in mm, in the units of a drive and of its axis; and whether the bus can
 * carry it.
 */
#ifndef INCISE_CAN_FIT_H
#define INCISE_CAN_FIT_H

#include "can_session.h"

/* The actuator's steps: as fine as the drive's counts, or as the profile can take them. */
void can_fit_steps(struct can_link *link);

/* link->setup, and how often both beat. */
void can_fit_setup(struct can_link *link);

/* The range of positions in it, after where 0 is. */
void can_fit_range(struct can_link *link);

/* link->axis. 0, -EINVAL, -ERANGE. */
int can_fit_axis(struct can_link *link, const char *where, struct incise_error *err);

/* How much of the bus it takes. 0; -ERANGE: more than it may. */
int can_fit_load(struct can_link *link, const char *where, struct incise_error *err);

/* 0; -EINVAL: a deadman that heartbeats in whole ms cannot keep. */
int can_fit_deadman(const struct incise_actuator *actuator, const char *where,
		    struct incise_error *err);

/* A speed or acceleration of the drive: whole, at least 1, rounded up. */
uint32_t can_fit_units(double value);

#endif
