/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A CAN bus over any transport: a socket of the kernel, a serial adapter, or a test's
 * simulation. Frames are the kernel's struct can_frame, or struct canfd_frame of a bus that was
 * opened for both; error frames (CAN_ERR_FLAG, see linux/can/error.h) come in between them.
 *
 *   canopen, can_axis ─▶ bus ─┬─▶ socketcan   can0       kernel
 *                             ╰─▶ slcan       /dev/ttyACM0
 *
 * One thread at a time. send and receive never wait; they return an error instead.
 */
#ifndef INCISE_CAN_BUS_H
#define INCISE_CAN_BUS_H

#include <stdbool.h>
#include <stdint.h>
#include <linux/can.h>
#include <incise/error.h>

struct can_bus;

/* The most that filter accepts. */
#define CAN_BUS_FILTERS 32

struct can_bus_ops {
	/* CLOCK_MONOTONIC, or the clock of a test; ns. */
	int64_t (*now)(struct can_bus *bus) INCISE_REALTIME;
	/*
	 * Returns 0; -ENOBUFS (the queue is full, the frame was not taken), -ENETDOWN,
	 * -ENODEV, -EIO, -EINVAL (an error frame, or too long). After -ENETDOWN or -ENODEV
	 * all functions fail, even if the interface comes back: the bus must be opened again.
	 */
	int (*send)(struct can_bus *bus, const struct can_frame *frame);
	/*
	 * Returns 1 (a frame; *t_ns: its time of arrival, the kernel's where available, not
	 * before the previous frame's nor after now), 0 (no frame); -ENETDOWN, -ENODEV, -EIO.
	 */
	int (*receive)(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns);
	/* Wait for a frame, at most until @until_ns. Returns 0, -EINTR, -ENETDOWN … */
	int (*wait)(struct can_bus *bus, int64_t until_ns);
	/*
	 * Receive only these and error frames; n = 0: all. Frames that the kernel has queued
	 * already still come. Returns 0 or -errno.
	 */
	int (*filter)(struct can_bus *bus, const struct can_filter *filter, int n);
	/*
	 * Returns enum can_state of linux/can/netlink.h, from the state at opening and the
	 * error frames received since; -EOPNOTSUPP: unknown.
	 */
	int (*state)(struct can_bus *bus);
	void (*close)(struct can_bus *bus);
	/* As send and receive, of a bus that was opened for CAN FD; or NULL. */
	int (*send_fd)(struct can_bus *bus, const struct canfd_frame *frame);
	int (*receive_fd)(struct can_bus *bus, struct canfd_frame *frame, int64_t *t_ns);
};

/* Counts of this side since the bus was opened. */
struct can_bus_counts {
	uint64_t sent, received;
	uint64_t full; /* frames not taken: -ENOBUFS */
	/* frames lost before they were read; slcan: how often some were */
	uint64_t overflow;
	uint64_t errors; /* error frames */
	uint64_t broken; /* input that was no frame: a line of slcan, a short read */
};

struct can_bus {
	const struct can_bus_ops *ops;
	char name[40];	  /* "can0", "/dev/ttyACM0": for messages */
	uint32_t bitrate; /* bit/s; 0: no bit rate (vcan), or unknown */
	struct can_bus_counts counts;
};

struct can_bus_request {
	const char *where;  /* prefix of messages */
	const char *device; /* "can0", "/dev/ttyACM0", "/dev/ttyACM0@500000" */
	/*
	 * can0: must equal the interface's; 0: any. slcan: the rate to set, which must equal
	 * that behind an @; 0: that one, else 1 Mbit/s.
	 */
	uint32_t bitrate;
	/*
	 * The node to drive, which one program at a time may do (EBUSY; likewise one program
	 * may have a serial line open). 0: only watch.
	 */
	uint8_t node;
	bool fd; /* the interface must take CAN FD frames */
};

/* A module has one transport. */
struct can_transport {
	const char *name; /* of the backend: "can", "slcan" */
	/* Returns 0; -EINVAL, -ENODEV, -ENETDOWN, -EBUSY, -EACCES, -EAFNOSUPPORT, -ENOMEM,
	 * -EIO, with the message in @err. */
	int (*open)(struct can_bus **bus, const struct can_bus_request *request,
		    struct incise_error *err);
	/* For a test with a simulated clock: no thread is started, and cycles run while a
	 * caller waits. NULL: the computer's clock. */
	void (*sleep_until)(struct can_bus *bus, int64_t t_ns);
};

extern const struct can_transport can_transport_socketcan, can_transport_slcan;

#endif
