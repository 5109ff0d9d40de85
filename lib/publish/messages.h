/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Rows of a recording as messages in a container; a profile says which rows, and how each is
 * encoded.
 *
 *     row of a stream ──► profile: JSON, or CDR of ROS 2 ──► MCAP
 */
#ifndef INCISE_MESSAGES_H
#define INCISE_MESSAGES_H

#include <incise/wall.h>
#include "../base/c_locale.h"
#include "../record/frames.h"
#include "interpolators.h"
#include "mcap.h"
#include "streams.h"

struct incise_messages {
	const struct incise_message_profile *profile;
	struct incise_export_pass *pass;
	struct incise_recording *recording;
	/* The streams that exist, and what each becomes; the number is that of its channel. */
	struct incise_stream_rows streams[INCISE_MCAP_CHANNELS_MAX];
	const struct incise_message_stream *kinds[INCISE_MCAP_CHANNELS_MAX];
	int n;
	struct incise_mcap mcap;
	struct incise_c_locale locale; /* of the caller */
	struct incise_wall *wall;      /* for times since 1970; or NULL, and then */
	int64_t wall_ns; /* added to CLOCK_MONOTONIC: nanoseconds since 1970, or 0 */
	char *text;	 /* of a message */
	size_t capacity;
	/* The camera's file, and the frame that was read last. */
	struct incise_frames_reader *frames;
	struct incise_camera_frame frame;
	bool any_frame;
	struct incise_blade_pose blade; /* for uncertainties of depths */
};

/* A stream as a topic. */
struct incise_message_stream {
	const char *table;
	/*
	 * Make the message of the stream's row in text, which has room for its texts. Returns its length; 0:
	 * the row has none; -ENOMEM, -EIO.
	 */
	int64_t (*encode)(struct incise_messages *messages,
			  const struct incise_stream_rows *stream);
	const struct incise_json_member *members; /* of JSON */
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
	int (*finish)(struct incise_messages *messages);
};

extern const struct incise_message_profile incise_messages_json, incise_messages_ros2;

/* Make text large enough for a message with so many bytes of texts or data. Returns 0 or -ENOMEM. */
int incise_messages_reserve(struct incise_messages *messages, size_t bytes);

/* Write pairs as metadata, and free them. Returns 0, -ENOMEM, -E2BIG. */
int incise_messages_pairs(struct incise_messages *messages, const char *name,
			  struct incise_provenance *pairs);

/* Time of a message, ns, at least 0. */
uint64_t incise_message_ns(const struct incise_messages *messages, int64_t t_ns);

#endif
