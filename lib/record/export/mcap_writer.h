/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages on their way into an MCAP file, the log format that viewers such as Foxglove
 * read; see the specification at https://mcap.dev/spec. Chunks are not compressed, and
 * indexed by time.
 *
 *     magic │ Header │ Schema, Channel … Metadata │ Chunk, MessageIndex … … │ DataEnd │
 *           │ summary: Schema, Channel …, Statistics, ChunkIndex …, MetadataIndex │
 *           │ SummaryOffset … │ Footer │ magic
 *
 * Times in ns. Memory is that of a chunk and of 100 bytes for each before. Not for
 * several threads.
 */
#ifndef INCISE_MCAP_WRITER_H
#define INCISE_MCAP_WRITER_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include "lineage.h"

struct incise_mcap;

/* Begin a file on a stream. NULL: ENOMEM. Failures from here on are kept for finish. */
struct incise_mcap *incise_mcap_new(FILE *out);

/*
 * Announce a topic with messages in JSON after a JSON Schema; texts must outlive the
 * file. All before the first message. Its number, or -ENOMEM, -E2BIG.
 */
int incise_mcap_channel(struct incise_mcap *mcap, const char *topic,
			const char *schema_name, const char *schema);

/* Pairs of key and text; one for each file, before the first message. */
void incise_mcap_metadata(struct incise_mcap *mcap, const char *name,
			  const struct incise_lineage *lineage);

/* Add a message. Returns 0, or -errno of the writes so far. */
int incise_mcap_message(struct incise_mcap *mcap, int channel, uint64_t t_ns,
			const char *json, size_t length);

/* End the file: 0, or the negative errno of what failed first. */
int incise_mcap_finish(struct incise_mcap *mcap);

void incise_mcap_free(struct incise_mcap *mcap);

#endif
