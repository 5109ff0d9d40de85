/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A session with a drive over its bus: find the drive, set it up after rig.conf, prepare it for
 * power, clear it; or watch it. All of this blocks and uses SDOs; the axis does the work of
 * each cycle.
 *
 *   rig.conf (mm) ─▶ session: counts, limits, load of the bus ─▶ drive
 *                      ╰─▶ axis
 */
#ifndef INCISE_CAN_SESSION_H
#define INCISE_CAN_SESSION_H

#include <incise/backend.h>
#include "can_axis.h"

struct can_session {
	struct can_bus *bus;
	struct canopen master;
	struct can_axis axis;
	struct incise_actuator actuator; /* its steps as fine as the profile allows */
	struct cia402_units units;
	struct cia402_supported supported;
	struct cia402_setup setup;
	char name[64];	       /* "drive 0x10 at can0" */
	uint32_t load_percent; /* of the bus; 0: it has no bit rate */

	/* private */
	struct cia402_client client;
	uint32_t boots; /* at the setup */
	bool is_setup, is_homed;
	bool in_range; /* the travel fits the drive's 32-bit counts */
	struct {
		int64_t tpdo_ns; /* the last TPDO1 */
		int64_t looked_ns;
		double position; /* steps, at that time */
	} watch;
};

/* Split "can0:0x10". Returns 0, -EINVAL. */
int can_session_parse(const char *arguments, char *device, size_t size,
		      unsigned int *node);

/*
 * Open the bus and set the drive up, without power. Call can_session_close() in any case.
 * Returns 0; -EBUSY (another master drives it), -ERANGE (the bus cannot carry the traffic, or
 * the profile is out of its range), and the errors of can_bus.h and cia402.h.
 */
int can_session_open(struct can_session *session, const struct can_transport *transport,
		     const struct incise_backend_request *request,
		     struct incise_error *err);

/*
 * Likewise for a drive that another program may drive. Nothing is written to it, except that
 * a drive without power and without another master enters homing mode for a moment, where it
 * reports whether it is homed.
 */
int can_session_watch(struct can_session *session, const struct can_transport *transport,
		      const struct incise_backend_request *request,
		      struct incise_error *err);

/*
 * Read the state of a watched drive into the axis, and publish it: from TPDOs while another
 * master sends SYNCs, else by SDO. Some ms, and 1 s if the drive does not answer.
 */
void can_session_watch_cycle(struct can_session *session);

/* Prepare for power: set up again after a reboot, enter its mode or homing mode. */
int can_session_ready(struct can_session *session, bool homing, struct incise_error *err);

/* Reset the fault, and set the drive up again. */
int can_session_clear(struct can_session *session, struct incise_error *err);

/* The drive has homed: from now on its 0 is the machine's. */
int can_session_homed(struct can_session *session, struct incise_error *err);

void can_session_close(struct can_session *session);

#endif
