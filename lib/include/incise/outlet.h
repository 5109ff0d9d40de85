/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Outlets: streams of numbers, or of texts, for any program that speaks the Lab Streaming Layer, or
 * topics of ROS 2. A module, outlet_lsl.so or outlet_ros2.so, is loaded by incise_outlets_open(), with
 * liblsl or Cyclone DDS; nothing else maps them. Part of libincise.
 */
#ifndef INCISE_OUTLET_H
#define INCISE_OUTLET_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** The protocol that readers speak. */
enum incise_outlet_protocol { INCISE_OUTLET_LSL, INCISE_OUTLET_ROS2 };

/** A channel, in the words of XDF. */
struct incise_outlet_channel {
	const char *label; /**< "Fz" */
	const char *type;  /**< "ForceZ" */
	const char *unit;  /**< "N" */
};

/** A stream of LSL, or a topic. */
struct incise_outlet_setup {
	/** By which others find it; of a topic without the first slash: "neck/measured_cp". */
	const char *name;
	/**
	 * LSL: of the content: "MoCap", "Force", "Markers". ROS 2: of the message, one of
	 * geometry_msgs/msg/PoseStamped (values: x, y, z in mm, quaternion w, x, y, z; sent in m),
	 * geometry_msgs/msg/WrenchStamped (values: x, y, z in N) and rcl_interfaces/msg/Log (text).
	 */
	const char *type;
	/* For LSL alone: */
	const char *source_id; /**< the same after a restart: others find it again */
	double rate_hz;	       /**< nominal; 0: irregular */
	const struct incise_outlet_channel *channels;
	int n; /**< channels; 0: one channel of text */
	/* For ROS 2 alone; the first outlet of a process sets domain and interface for all: */
	const char *frame; /**< header.frame_id; lives until the outlet is closed */
	int domain;	   /**< 0 to 232 */
	/** Network interface; "lo": this machine; NULL: as CYCLONEDDS_URI has it. */
	const char *interface;
};

struct incise_outlet;

/**
 * Functions of the module, for one thread. The library has threads of its own, which get the signal mask
 * of the caller of open(): block all signals there. A reader that is slower than 10 s (LSL) or 10 values
 * (ROS 2) loses the oldest.
 */
struct incise_outlets {
	/** Offer a stream. NULL with errno EINVAL (no such type), EIO, ENOMEM, and a message. */
	struct incise_outlet *(*open)(const struct incise_outlet_setup *setup,
				      struct incise_error *err);
	/** Send the values of all channels; never waits. @t_ns: CLOCK_MONOTONIC; for ROS 2, UTC. */
	void (*push)(struct incise_outlet *outlet, const double *values, int64_t t_ns);
	/** The same for a stream of text. */
	void (*push_text)(struct incise_outlet *outlet, const char *text, int64_t t_ns);
	/** Whether a client reads it now. */
	bool (*has_readers)(struct incise_outlet *outlet);
	/** End the stream; NULL is accepted. */
	void (*close)(struct incise_outlet *outlet);
};

/**
 * Load the module and its library.
 *
 * @param where    begin of messages: the option or key that asks for it
 * @param protocol of the module
 * @param outlets  result, static
 * @return 0; -ENOENT (no module, or no library: the message says what to install), -ENOEXEC (one
 *         of the two is broken)
 */
INCISE_API int incise_outlets_open(const char *where,
				   enum incise_outlet_protocol protocol,
				   const struct incise_outlets **outlets,
				   struct incise_error *err);

INCISE_END_DECLS
#endif
