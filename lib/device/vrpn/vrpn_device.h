/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A device of a VRPN server, "NAME@HOST[:PORT]", from the bytes of one socket, which may be anything.
 * VRPN 07 by TCP: big-endian, metres.
 *
 *     cookie, 24 bytes, each way    then messages
 *     ┌──────────────────┬───────┐  ┌────────┬───┬────┬────────┬──────┬──────┬─────────┬─────────┐
 *     │"vrpn: ver. 07.38"│"  0"  │  │ length │ s │ µs │ sender │ type │ any  │ payload │ to 8 n  │
 *     └──────────────────┴───────┘  │ 4      │ 4 │ 4  │ 4      │ 4    │ 4    │         │ padding │
 *                                   └────────┴───┴────┴────────┴──────┴──────┴─────────┴─────────┘
 *                                    24 + payload, without the padding
 *
 * Each side numbers senders (devices) and types, and describes them in messages of types -1 and -2
 * with the number in place of the sender. What is not described, or not used here, is passed over.
 * Neither side offers UDP, so all goes by TCP.
 *
 * Time: on this machine the server's timestamps are of CLOCK_REALTIME, and exact; sender_clock.h maps
 * those of another machine, without the least delay of the network, which nobody here can know. A
 * timestamp after its arrival, or a second before, is of another clock, wherever the server seems to be.
 *
 * A connection that breaks is made again:
 *
 *     poses ── it breaks ──▶ one sample, not ready ── each 250 ms, for 10 s ──▶ poses
 *     force      0                   0                       0                0, until a push of 0
 */
#ifndef INCISE_VRPN_DEVICE_H
#define INCISE_VRPN_DEVICE_H

#include <incise/backend.h>
#include "../../rig/backends.h"
#include "../../rig/haptic_backend.h"
#include "../../rig/pace.h"
#include "../../rig/sender_clock.h"
#include "../../rig/server_link.h"
#include "../../rig/tracker_feed.h"

#define VRPN_SENSORS 32
#define VRPN_NAME 100	/* longest name, with its zero */
#define VRPN_MOST 65536 /* bytes of a message; VRPN's own limit is 64000 */

enum vrpn_type {
	VRPN_POSE,
	VRPN_VELOCITY,
	VRPN_BUTTON,
	VRPN_BUTTONS,
	VRPN_FORCE_ERROR,
	VRPN_FORCE_FIELD,
};
#define VRPN_TYPES 6

struct vrpn_pose {
	struct incise_haptic_sample sample; /* seq counts those of all sensors */
	int64_t utc_ns;
	int sensor;
	bool sound; /* finite, within 1 km, a rotation */
};

struct vrpn_device {
	/* A tracker uses error, cause, lost, and of info the name and the rate, too. */
	union {
		struct incise_haptic haptic;
		struct incise_tracker tracker;
	}; /* first */
	struct server_link link;
	char device[VRPN_NAME]; /* as the server has it */
	uint8_t bytes[2 * VRPN_MOST];
	size_t at, n; /* bytes that are used, and that are there */
	bool greeted; /* the server's cookie is through */
	bool met;     /* ours is, too */
	bool named;   /* the server has the names behind the numbers of forces */
	/* Numbers of the server; -1: not described. */
	int32_t sender, types[VRPN_TYPES];
	struct vrpn_pose last; /* waits for its velocity */
	bool waits;
	bool own_machine;
	struct incise_sender_clock clock;
	int64_t arrival_ns, sound_ns; /* of what came last, and of the last sound pose */
	int64_t silent_ns;	      /* after so long without one it is broken */
	uint32_t sensors;	      /* that are used, as bits */
	double origin_m[3];	      /* the last sound position */
	uint32_t pressed;
	int force_error; /* of the device, by its server; 0: none */
	bool forces;	 /* it is to take them … */
	bool held;	 /* … after a push of none */
	bool leaving; /* it has sent its last force, and drops poses until it is closed */
	bool learnt;  /* rate and age are known: a link that breaks is made again */
	int64_t broken_ns; /* without a sound pose since; 0: not broken */
	int64_t retry_ns;  /* of the next connection */
	/* A tracker has these. */
	struct incise_tracker_setup setup;
	struct tracker_repeat repeat[VRPN_SENSORS];
	struct incise_pace pace;
	uint64_t missing;
};

/* Start from zeros, without a connection. */
void vrpn_device_init(struct vrpn_device *device, uint32_t sensors, int64_t silent_ns);

/*
 * Connect, and receive poses of some sensors until their rate is known. @forces: it is to take them. NULL
 * with errno and a message.
 */
struct vrpn_device *vrpn_device_new(const struct incise_backend_request *request,
				    uint32_t sensors, int64_t silent_ns, bool forces,
				    struct incise_error *err);

/* No force, after a failure, too; then close it. */
void vrpn_device_free(struct vrpn_device *device);

/* Receive what is there, without waiting, or connect again. 0 or the device's error. */
int vrpn_device_receive(struct vrpn_device *device);

/* The next pose from what was received. 1; 0: there is none; or the device's error. */
int vrpn_device_pose(struct vrpn_device *device, struct vrpn_pose *pose);

/* The same force within some metres of the last sound pose. 0 or the device's error. */
int vrpn_device_force(struct vrpn_device *device, const double force_N[3]);

#endif
