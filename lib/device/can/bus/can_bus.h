/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A CAN bus, whatever carries its frames: a socket of the kernel, a serial adapter, or what
 * a test makes up. Frames are the kernel's own struct can_frame; error frames
 * (CAN_ERR_FLAG) come in between them, as linux/can/error.h says.
 *
 *   canopen, axis ─▶ bus ─┬─▶ socketcan   can0       kernel
 *                         ╰─▶ slcan       /dev/ttyACM0
 *
 * One thread at a time. send and receive never wait; what they cannot do now they say.
 */
#ifndef INCISE_CAN_BUS_H
#define INCISE_CAN_BUS_H

#include <stdbool.h>
#include <stdint.h>
#include <linux/can.h>
#include <incise/error.h>

struct can_bus;

/* As many at most may be given to filter. */
#define CAN_BUS_FILTERS 32

struct can_bus_ops {
	/* CLOCK_MONOTONIC, ns; a test's own clock. */
	int64_t (*now)(struct can_bus *bus) INCISE_REALTIME;
	/*
	 * 0; -ENOBUFS (the queue is full; the frame was not taken, nothing else was hurt),
	 * -ENETDOWN, -ENODEV, -EIO, -EINVAL (no frame for a bus: an error frame, too long).
	 * What went down or away stays so for this bus, of all functions, even if the
	 * interface comes back: it must be opened again.
	 */
	int (*send)(struct can_bus *bus, const struct can_frame *frame);
	/*
	 * 1 (a frame; *t_ns: when it came, by the kernel where it tells; never before that
	 * of the frame before it, nor after now), 0 (there is none); -ENETDOWN, -ENODEV,
	 * -EIO.
	 */
	int (*receive)(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns);
	/* Until a frame may be there, or @until_ns has come. 0, -EINTR, -ENETDOWN … */
	int (*wait)(struct can_bus *bus, int64_t until_ns);
	/*
	 * Only these are received, and error frames; n = 0: all. What the kernel has in its
	 * queue already still comes. 0 or -errno.
	 */
	int (*filter)(struct can_bus *bus, const struct can_filter *filter, int n);
	/*
	 * enum can_state of linux/can/netlink.h, by what was told when it was opened and the
	 * error frames that were received since; -EOPNOTSUPP (not known).
	 */
	int (*state)(struct can_bus *bus);
	void (*close)(struct can_bus *bus);
};

/* Of this side; since it was opened. */
struct can_bus_counts {
	uint64_t sent, received;
	uint64_t full; /* frames not taken: -ENOBUFS */
	/* frames lost before they could be read; of slcan: times that some were */
	uint64_t overflow;
	uint64_t errors; /* error frames */
	uint64_t broken; /* what was no frame: a line of slcan, a short read */
};

struct can_bus {
	const struct can_bus_ops *ops;
	char name[40];	  /* "can0", "/dev/ttyACM0": for messages */
	uint32_t bitrate; /* bit/s; 0: there is none (vcan), or it is not known */
	uint32_t
		restart_ms; /* the kernel leaves bus-off by itself after so long; 0: not */
	struct can_bus_counts counts;
};

/* What a bus is opened for. */
struct can_bus_request {
	const char *where;  /* messages begin with it */
	const char *device; /* "can0", "/dev/ttyACM0", "/dev/ttyACM0@500000" */
	/*
	 * can0: must be its own; 0: as it is. slcan: is set, and must be the one behind the
	 * @ where there is one; 0: that, or 1 Mbit/s.
	 */
	uint32_t bitrate;
	/*
	 * To drive the node: only one program at a time may, and only one may have a serial
	 * line open (EBUSY). 0: to look.
	 */
	uint8_t node;
};

/* A way to open one; of each module its own. */
struct can_transport {
	const char *name; /* "can", "slcan": of the backend */
	/* 0; -EINVAL, -ENODEV, -ENETDOWN, -EBUSY, -EACCES, -EAFNOSUPPORT, -ENOMEM, -EIO, and
	 * the line in @err. */
	int (*open)(struct can_bus **bus, const struct can_bus_request *request,
		    struct incise_error *err);
	/* Of a test whose time goes only when it is told to: no thread is started, and cycles
	 * run while somebody waits. NULL: the computer's clock. */
	void (*sleep_until)(struct can_bus *bus, int64_t t_ns);
};

extern const struct can_transport can_transport_socketcan, can_transport_slcan;

#endif
