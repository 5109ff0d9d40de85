/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A drive and the bus that leads to it: found, set up after rig.conf, made ready for power,
 * cleared. All of it blocks and goes by SDO; what is done in each cycle is the axis's.
 *
 *   rig.conf (mm) ─▶ link: counts, limits, load of the bus ─▶ drive
 *                      ╰─▶ axis
 */
#ifndef INCISE_CAN_LINK_H
#define INCISE_CAN_LINK_H

#include <incise/actuator.h>
#include <incise/backend.h>
#include "can_axis.h"

struct can_link {
	struct can_bus *bus;
	struct canopen master;
	struct can_axis axis;
	struct incise_actuator
		actuator; /* steps are as fine as the profile can have them */
	struct cia402_identity identity;
	struct cia402_units units;
	struct cia402_taken taken;
	struct cia402_setup setup;
	char where[64];	       /* "drive 0x10 at can0" */
	uint32_t load_percent; /* of the bus; 0: it has no bit rate */

	/* private */
	uint32_t boots; /* when it was set up */
	bool is_setup, is_homed;
	bool in_range; /* all of the travel, in the drive's 32-bit counts */
};

/* "can0:0x10" in its parts. 0, -EINVAL. */
int can_link_parse(const char *arguments, char *device, size_t size, unsigned int *node);

/*
 * Open the bus and set the drive up, without power. can_link_close() in both cases. 0;
 * -EBUSY (another master drives it), -ERANGE (the bus cannot carry it, or the profile is
 * out of its range), and what can_bus.h and cia402.h say.
 */
int can_link_open(struct can_link *link, const struct can_transport *transport,
		  const struct incise_backend_request *request, struct incise_error *err);

/*
 * The same to look: the drive is asked what it is. Nothing is written but, where nobody drives
 * it and it has no power, its mode for a moment: homing mode tells whether it has homed.
 */
int can_link_look(struct can_link *link, const struct can_transport *transport,
		  const struct incise_backend_request *request, struct incise_error *err);

/* Before power: set up again where it rebooted, in its mode or in homing mode, operational. */
int can_link_ready(struct can_link *link, bool homing, struct incise_error *err);

/* Take it out of its fault, and set it up again. */
int can_link_clear(struct can_link *link, struct incise_error *err);

/* It has homed: its 0 is that of the machine from now on. */
int can_link_homed(struct can_link *link, struct incise_error *err);

/* Note why a drive is in fault, by its own error code; a reason that is known stays. */
void can_link_ask_why(struct can_link *link);

void can_link_close(struct can_link *link);

#endif
