/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The container of MCAP, the log format of viewers such as Foxglove: channels of messages, in
 * chunks that are indexed by time. What a message contains is the caller's; see messages.h.
 *
 *     mcap_begin ─► mcap_channel … mcap_metadata … ─► mcap_message … ─► mcap_finish ─► mcap_free
 *
 * Memory is that of a chunk and of 100 bytes for each one before. Failures are kept until
 * incise_mcap_finish().
 */
#ifndef INCISE_MCAP_H
#define INCISE_MCAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include "provenance.h"

#define INCISE_MCAP_CHANNELS_MAX 5

/* A growing buffer. */
struct incise_mcap_bytes {
	unsigned char *data;
	size_t n, capacity;
	bool failed; /* no memory */
};

/* Messages of one topic. Texts must outlive the file. */
struct incise_mcap_channel {
	const char *topic, *encoding; /* of the messages: json, cdr */
	const char *schema_name, *schema_encoding, *schema;
	const char *qos; /* metadata offered_qos_profiles of ROS 2; NULL: none */

	/* The container's. */
	uint64_t messages;
	struct incise_mcap_bytes index; /* of the chunk: log_time, offset; 8 bytes each */
};

struct incise_mcap {
	FILE *out;
	int rc;	      /* first failure */
	uint32_t crc; /* of the present section */
	uint64_t at;  /* bytes written */
	struct incise_mcap_channel channels[INCISE_MCAP_CHANNELS_MAX];
	int n_channels;
	struct incise_mcap_bytes record; /* the present one */
	struct incise_mcap_bytes chunk;	 /* its records */
	uint64_t first_ns, last_ns, chunk_first_ns, chunk_last_ns;
	struct incise_mcap_bytes chunk_indexes,
		metadata_index; /* whole records, for the summary */
	uint64_t chunks, metadata;
};

/* Start a file; @profile: what its messages follow, or "". */
void incise_mcap_begin(struct incise_mcap *mcap, FILE *out, const char *profile);

/* Announce a topic. Returns the number of its channel. */
int incise_mcap_channel(struct incise_mcap *mcap,
			const struct incise_mcap_channel *channel);

void incise_mcap_metadata(struct incise_mcap *mcap, const char *name,
			  const struct incise_provenance *pairs);

/* Add a message. Returns 0, or -errno of the writes so far. */
int incise_mcap_message(struct incise_mcap *mcap, int channel, uint64_t t_ns,
			const char *data, size_t length);

/* End the file: 0, or the negative errno of the first failure. */
int incise_mcap_finish(struct incise_mcap *mcap);

/* Free the memory. */
void incise_mcap_free(struct incise_mcap *mcap);

#endif
