/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From bytes of an OpenIGTLink server to samples in a ring:
 *
 *   bytes -> incise_igtl_stream -> TRANSFORM, POSITION or TDATA of the device -> rotation to
 *   quaternion -> time -> seq and losses -> flag, offset, mm -> ring -> reader
 *
 * The sender's timestamps are mapped to the clock here, see sender_clock.h; without them a
 * sample's time is its arrival.
 *
 * Without thread, clock or socket, so that tests have their own time, in ns.
 */
#ifndef INCISE_IGTL_POSES_H
#define INCISE_IGTL_POSES_H

#include <stdatomic.h>
#include <incise/tracker.h>
#include "../../base/ring.h"
#include "../../rig/pace.h"
#include "../../rig/sender_clock.h"
#include "../../rig/tracker_feed.h"
#include "igtl_message.h"

#define IGTL_NAMES 8 /* of devices that are remembered for a message */

struct igtl_poses {
	struct incise_tracker_setup setup;
	char device[IGTL_HEADER_NAME_SIZE + 1]; /* "": any */
	struct incise_igtl_stream *stream;
	struct incise_ring ring; /* of struct incise_tracker_sample */
	struct incise_pace pace;
	uint64_t seq; /* of the next sample */
	_Atomic uint64_t lost;
	_Atomic bool unsure; /* that may lack some */
	uint64_t messages;   /* whole ones, of any type and device */
	bool counts;	     /* igtl_poses_start() was called */
	bool restarted;	     /* the next sample is marked so */
	bool refused;	     /* the device's last STATUS was an error */
	/* Names of devices that sent poses. */
	char names[IGTL_NAMES][IGTL_HEADER_NAME_SIZE + 1];
	int n_names;
	/* Poses so far, and times of the first and the last one. */
	uint64_t n;
	int64_t first_ns, last_ns;
	int64_t stamp_ns; /* of the last pose */
	struct incise_sender_clock clock;
	double matrix[3][4]; /* of the last pose */
	bool coarse; /* other poses came with an equal timestamp: arrivals are used */
	uint64_t damaged; /* messages with a wrong CRC before igtl_poses_start() */
	/* Steps of the poses to the one before, and to that before it. */
	double before_mm[2][3], step_mm, step2_mm;
	struct tracker_repeat repeat;
};

/* @device: whose poses are taken; "" takes any. 0 or -ENOMEM. @setup is copied. */
int igtl_poses_init(struct igtl_poses *poses, const struct incise_tracker_setup *setup,
		    const char *device);
void igtl_poses_free(struct igtl_poses *poses);

/* Poses per second of those so far; 0: there are too few, or the device of "" is not clear. */
double igtl_poses_hz(const struct igtl_poses *poses);

/* Whether the poses so far go to and fro between two places, as those of two senders of one name do. */
bool igtl_poses_alternate(const struct igtl_poses *poses);

/* Forget the samples so far, number from 0, and count losses from here, at @rate_hz. */
void igtl_poses_start(struct igtl_poses *poses, double rate_hz);

/* Another connection: bytes start with a header. 0 or -ENOMEM. */
int igtl_poses_reconnected(struct igtl_poses *poses);

/* Bytes that arrived at @t_ns: 0, or -EPROTO (not OpenIGTLink). */
int igtl_poses_put(struct igtl_poses *poses, const uint8_t *bytes, size_t n,
		   int64_t t_ns);

#endif
