/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From rig.conf in mm to the units of a drive and of its axis, with a check that the bus can
 * carry the traffic, with as many stuff bits as its frames can have. Nothing here uses the bus.
 */
#ifndef INCISE_CAN_UNITS_H
#define INCISE_CAN_UNITS_H

#include "can_session.h"

/* Set the actuator's steps: as fine as counts and profile allow. -ERANGE: counts are too coarse. */
int can_units_steps(struct can_session *session);

/* Returns the drive's counts per mm; negative if inverted. */
double can_units_per_mm(const struct can_session *session);

/* Compute session->setup, and the period of both heartbeats. */
void can_units_setup(struct can_session *session);

/* Compute the range in the setup from the place of 0; unlimited before homing. Sets in_range. */
void can_units_range(struct can_session *session);

/* Initialize session->axis. Returns 0, -EINVAL, -ERANGE. */
int can_units_axis(struct can_session *session);

/* Compute load_percent. Returns 0; -ERANGE: more than the bus can carry. */
int can_units_load(struct can_session *session);

/* Returns 0; -EINVAL: heartbeats in whole ms cannot keep such a short deadman off. */
int can_units_deadman(const struct can_session *session);

/* Returns a speed or acceleration in the drive's units: whole, at least 1, rounded up. */
uint32_t can_units_whole(double value);

/*
 * Returns the bits of a frame with an 11-bit id and @bytes bytes, with the gap to the next
 * frame: 55 … 135. More than 8 bytes count as 8.
 */
uint32_t bus_load_bits(unsigned int bytes);

/*
 * Returns the cyclic traffic, bit/s: SYNC, RPDO and TPDO per cycle, both heartbeats each
 * @heartbeat_ns (0: no heartbeats), inputs at their highest rate. UINT32_MAX: more than that,
 * or a cycle of 0.
 */
uint32_t bus_load_of(uint32_t cycle_ns, unsigned int rpdo_bytes, unsigned int tpdo_bytes,
		     int64_t heartbeat_ns);

/* The largest load, %: the rest is for SDOs, EMCYs and repeated frames. */
#define BUS_LOAD_MOST 80

#endif
