/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Rows of a recording as messages in a container; a profile says which rows, and how each is
 * encoded.
 *
 *     force ──┐
 *     tracker ├──► the earliest ──► profile: JSON, or CDR of ROS 2 ──► MCAP
 *     …      ─┘
 */
#ifndef INCISE_MESSAGES_H
#define INCISE_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/budget.h>
#include <incise/wall.h>
#include "../frames.h"
#include "../read/recording.h"
#include "../read/rows.h"
#include "interpolators.h"
#include "mcap.h"

struct incise_messages {
	struct incise_recording *recording;
	struct incise_recording_force scale;
	uint64_t clipped, omitted; /* force samples at an end; rows without a message */
	struct incise_wall *wall;  /* for times since 1970; or NULL, and then */
	int64_t wall_ns; /* added to CLOCK_MONOTONIC: nanoseconds since 1970, or 0 */
	char *text;	 /* of a message */
	size_t capacity;
	/* Of the camera: its file, and the frame that was read last. */
	struct incise_frames_reader *frames;
	struct incise_camera_frame frame;
	bool any_frame;
	/* Uncertainties: the budget or NULL, with the pose for those of depths. */
	struct incise_budget *budget;
	struct incise_blade_pose blade;
	enum incise_export_uncertainty uncertainty;
};

/* A table as a topic. */
struct incise_message_stream {
	const char *table, *columns; /* as of incise_rows_open() */
	/*
	 * Make the message of a row in text. Returns its length; 0: the row has none; -EINVAL: the
	 * row is impossible; -ENOMEM, -EIO.
	 */
	int64_t (*encode)(struct incise_messages *messages,
			  const struct incise_rows *rows);
	const char *topic, *schema_name, *schema;
};

struct incise_message_profile {
	const char *name, *encoding, *schema_encoding, *qos; /* as of mcap.h */
	const struct incise_message_stream *streams;
	int n;	   /* of them, up to INCISE_MCAP_CHANNELS_MAX */
	bool wall; /* times are since 1970 */

	/* Get the streams that exist, a bit for each; or -errno. NULL: all exist. */
	int (*select)(struct incise_messages *messages, struct incise_error *err);
	/* Add metadata behind the last message; NULL: none. Returns 0 or -errno. */
	int (*finish)(const struct incise_message_profile *profile,
		      struct incise_mcap *mcap);
};

extern const struct incise_message_profile incise_messages_json, incise_messages_ros2;

/* Make text large enough for a message. Returns 0 or -ENOMEM. */
int incise_messages_reserve(struct incise_messages *messages, size_t bytes);

/*
 * The force of a row "seq, t_ns, code"; counts clipped ones. Returns the code, or -EINVAL: it is
 * impossible.
 */
int64_t incise_message_force(struct incise_messages *messages,
			     const struct incise_rows *rows, double *force_N,
			     bool *clipped);

/* Time of a message, ns, at least 0. */
uint64_t incise_message_ns(const struct incise_messages *messages, int64_t t_ns);

#endif
