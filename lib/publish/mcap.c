// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * MCAP, the log format of viewers such as Foxglove; see mcap.h and https://mcap.dev/spec.
 *
 *     magic │ Header │ Schema, Channel … Metadata │ Chunk, MessageIndex … … │ DataEnd │
 *           │ summary: Schema, Channel …, Statistics, ChunkIndex …, MetadataIndex │
 *           │ SummaryOffset … │ Footer │ magic
 *
 * Names of records and fields are those of the specification; numbers are little-endian, times
 * in ns. Chunks are not compressed, and indexed by time.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>
#include <incise/version.h>
#include "mcap.h"

#define CHUNK_SIZE (1 << 20)

enum opcode {
	HEADER = 1,
	FOOTER,
	SCHEMA,
	CHANNEL,
	MESSAGE,
	CHUNK,
	MESSAGE_INDEX,
	CHUNK_INDEX,
	STATISTICS = 0x0b,
	METADATA,
	METADATA_INDEX,
	SUMMARY_OFFSET,
	DATA_END,
};

static const unsigned char magic[8] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

static unsigned char *grow_mcap(struct incise_mcap_bytes *bytes, size_t n)
{
	unsigned char *at;

	if (bytes->n + n > bytes->capacity) {
		size_t capacity = 2 * (bytes->n + n);
		unsigned char *data = realloc(bytes->data, capacity);

		if (!data) {
			bytes->failed = true;
			return NULL;
		}
		bytes->data = data;
		bytes->capacity = capacity;
	}
	at = bytes->data + bytes->n;
	bytes->n += n;
	return at;
}

static void put_mcap(struct incise_mcap_bytes *bytes, const void *data, size_t n)
{
	unsigned char *at = n ? grow_mcap(bytes, n) : NULL;

	if (at)
		memcpy(at, data, n);
}

static void put_mcap_number(struct incise_mcap_bytes *bytes, uint64_t value, int size)
{
	unsigned char *at = grow_mcap(bytes, size);

	for (int i = 0; at && i < size; i++)
		at[i] = value >> (8 * i);
}

static void put_mcap_text(struct incise_mcap_bytes *bytes, const char *text)
{
	put_mcap_number(bytes, strlen(text), 4);
	put_mcap(bytes, text, strlen(text));
}

/* Fill in a length, now that its end is written. */
static void close_length(struct incise_mcap_bytes *bytes, size_t at, int size)
{
	uint64_t length = bytes->n - at - size;

	for (int i = 0; !bytes->failed && i < size; i++)
		bytes->data[at + i] = length >> (8 * i);
}

static void put_pairs(struct incise_mcap_bytes *bytes,
		      const struct incise_provenance *provenance)
{
	size_t at = bytes->n;

	put_mcap_number(bytes, 0, 4);
	for (int i = 0; i < provenance->n; i++) {
		put_mcap_text(bytes, provenance->items[i].key);
		put_mcap_text(bytes, provenance->items[i].value);
	}
	close_length(bytes, at, 4);
}

static void write_bytes(struct incise_mcap *mcap, const void *data, size_t n)
{
	if (mcap->rc || !n)
		return;
	errno = 0;
	if (fwrite(data, 1, n, mcap->out) != n)
		mcap->rc = errno ? -errno : -EIO;
	mcap->crc = (uint32_t)crc32_z(mcap->crc, data, n);
	mcap->at += n;
}

static struct incise_mcap_bytes *begin_mcap(struct incise_mcap *mcap, enum opcode opcode)
{
	mcap->record.n = 0;
	put_mcap_number(&mcap->record, opcode, 1);
	put_mcap_number(&mcap->record, 0, 8);
	return &mcap->record;
}

/* Write the record, or add it to @summary if that is not NULL. */
static void end_mcap(struct incise_mcap *mcap, struct incise_mcap_bytes *summary)
{
	close_length(&mcap->record, 1, 8);
	if (mcap->record.failed && !mcap->rc)
		mcap->rc = -ENOMEM;
	if (!summary)
		write_bytes(mcap, mcap->record.data, mcap->record.n);
	else
		put_mcap(summary, mcap->record.data, mcap->record.n);
	if (summary && summary->failed && !mcap->rc)
		mcap->rc = -ENOMEM;
}

static void write_schema(struct incise_mcap *mcap, int i)
{
	struct incise_mcap_bytes *to = begin_mcap(mcap, SCHEMA);

	put_mcap_number(to, i + 1, 2); /* 0 would be none */
	put_mcap_text(to, mcap->channels[i].schema_name);
	put_mcap_text(to, mcap->channels[i].schema_encoding);
	put_mcap_text(to, mcap->channels[i].schema);
	end_mcap(mcap, NULL);
}

static void write_channel(struct incise_mcap *mcap, int i)
{
	struct incise_mcap_bytes *to = begin_mcap(mcap, CHANNEL);
	size_t at;

	put_mcap_number(to, i, 2);
	put_mcap_number(to, i + 1, 2);
	put_mcap_text(to, mcap->channels[i].topic);
	put_mcap_text(to, mcap->channels[i].encoding);
	at = to->n;
	put_mcap_number(to, 0, 4);
	if (mcap->channels[i].qos) {
		put_mcap_text(to, "offered_qos_profiles");
		put_mcap_text(to, mcap->channels[i].qos);
	}
	close_length(to, at, 4);
	end_mcap(mcap, NULL);
}

/* A map from the channels to a number each; those of 0 may be left out. */
static void put_channels(struct incise_mcap_bytes *to, const struct incise_mcap *mcap,
			 const uint64_t *numbers, bool zeros)
{
	size_t at = to->n;

	put_mcap_number(to, 0, 4);
	for (int i = 0; i < mcap->n_channels; i++)
		if (zeros || numbers[i]) {
			put_mcap_number(to, i, 2);
			put_mcap_number(to, numbers[i], 8);
		}
	close_length(to, at, 4);
}

/* Write the chunk, and its indexes behind it. */
static void write_chunk(struct incise_mcap *mcap)
{
	uint64_t start = mcap->at, length, indexes;
	uint64_t offsets[INCISE_MCAP_CHANNELS_MAX];
	struct incise_mcap_bytes *to = begin_mcap(mcap, CHUNK);

	put_mcap_number(to, mcap->chunk_first_ns, 8);
	put_mcap_number(to, mcap->chunk_last_ns, 8);
	put_mcap_number(to, mcap->chunk.n, 8);
	put_mcap_number(to, (uint32_t)crc32_z(0, mcap->chunk.data, mcap->chunk.n), 4);
	put_mcap_text(to, ""); /* not compressed */
	put_mcap_number(to, mcap->chunk.n, 8);
	put_mcap(to, mcap->chunk.data, mcap->chunk.n);
	end_mcap(mcap, NULL);
	length = mcap->at - start;
	indexes = mcap->at;
	for (int i = 0; i < mcap->n_channels; i++) {
		struct incise_mcap_bytes *index = &mcap->channels[i].index;

		offsets[i] = index->n ? mcap->at : 0;
		if (!index->n)
			continue;
		to = begin_mcap(mcap, MESSAGE_INDEX);
		put_mcap_number(to, i, 2);
		put_mcap_number(to, index->n, 4);
		put_mcap(to, index->data, index->n);
		end_mcap(mcap, NULL);
		index->n = 0;
	}
	to = begin_mcap(mcap, CHUNK_INDEX);
	put_mcap_number(to, mcap->chunk_first_ns, 8);
	put_mcap_number(to, mcap->chunk_last_ns, 8);
	put_mcap_number(to, start, 8);
	put_mcap_number(to, length, 8);
	put_channels(to, mcap, offsets, false);
	put_mcap_number(to, mcap->at - indexes, 8);
	put_mcap_text(to, "");
	put_mcap_number(to, mcap->chunk.n, 8);
	put_mcap_number(to, mcap->chunk.n, 8);
	end_mcap(mcap, &mcap->chunk_indexes);
	mcap->chunks++;
	mcap->chunk.n = 0;
}

int incise_mcap_message(struct incise_mcap *mcap, int channel, uint64_t t_ns,
			const char *data, size_t length)
{
	struct incise_mcap_channel *of = &mcap->channels[channel];
	struct incise_mcap_bytes *to = &mcap->chunk;

	put_mcap_number(&of->index, t_ns, 8);
	put_mcap_number(&of->index, to->n, 8);
	if (!to->n || t_ns < mcap->chunk_first_ns)
		mcap->chunk_first_ns = t_ns;
	if (!to->n || t_ns > mcap->chunk_last_ns)
		mcap->chunk_last_ns = t_ns;
	if ((!to->n && !mcap->chunks) || t_ns < mcap->first_ns)
		mcap->first_ns = t_ns;
	if ((!to->n && !mcap->chunks) || t_ns > mcap->last_ns)
		mcap->last_ns = t_ns;
	put_mcap_number(to, MESSAGE, 1);
	put_mcap_number(to, 22 + length, 8);
	put_mcap_number(to, channel, 2);
	put_mcap_number(to, of->messages++, 4); /* modulo 2^32, which readers accept */
	put_mcap_number(to, t_ns, 8);		/* log_time */
	put_mcap_number(to, t_ns, 8);		/* publish_time */
	put_mcap(to, data, length);
	if ((to->failed || of->index.failed) && !mcap->rc)
		mcap->rc = -ENOMEM;
	if (to->n >= CHUNK_SIZE && !mcap->rc)
		write_chunk(mcap);
	return mcap->rc;
}

void incise_mcap_begin(struct incise_mcap *mcap, FILE *out, const char *profile)
{
	struct incise_mcap_bytes *to;

	*mcap = (struct incise_mcap){.out = out};
	write_bytes(mcap, magic, sizeof(magic));
	to = begin_mcap(mcap, HEADER);
	put_mcap_text(to, profile);
	put_mcap_text(to, "incise " INCISE_VERSION);
	end_mcap(mcap, NULL);
}

int incise_mcap_channel(struct incise_mcap *mcap,
			const struct incise_mcap_channel *channel)
{
	int i = mcap->n_channels++;

	mcap->channels[i] = *channel;
	write_schema(mcap, i);
	write_channel(mcap, i);
	return i;
}

void incise_mcap_metadata(struct incise_mcap *mcap, const char *name,
			  const struct incise_provenance *provenance)
{
	uint64_t start = mcap->at;
	struct incise_mcap_bytes *to = begin_mcap(mcap, METADATA);

	put_mcap_text(to, name);
	put_pairs(to, provenance);
	end_mcap(mcap, NULL);
	to = begin_mcap(mcap, METADATA_INDEX);
	put_mcap_number(to, start, 8);
	put_mcap_number(to, mcap->at - start, 8);
	put_mcap_text(to, name);
	end_mcap(mcap, &mcap->metadata_index);
	mcap->metadata++;
}

static void write_statistics(struct incise_mcap *mcap)
{
	struct incise_mcap_bytes *to = begin_mcap(mcap, STATISTICS);
	uint64_t counts[INCISE_MCAP_CHANNELS_MAX], messages = 0;

	for (int i = 0; i < mcap->n_channels; i++)
		messages += counts[i] = mcap->channels[i].messages;
	put_mcap_number(to, messages, 8);
	put_mcap_number(to, mcap->n_channels, 2);
	put_mcap_number(to, mcap->n_channels, 4);
	put_mcap_number(to, 0, 4); /* attachments */
	put_mcap_number(to, mcap->metadata, 4);
	put_mcap_number(to, mcap->chunks, 4);
	put_mcap_number(to, mcap->first_ns, 8);
	put_mcap_number(to, mcap->last_ns, 8);
	put_channels(to, mcap, counts, true);
	end_mcap(mcap, NULL);
}

/* The records of each kind, and behind them where those of a kind are. */
static void write_summary(struct incise_mcap *mcap)
{
	static const enum opcode order[] = {SCHEMA, CHANNEL, STATISTICS, CHUNK_INDEX,
					    METADATA_INDEX};
	uint64_t starts[6];
	struct incise_mcap_bytes *to;

	mcap->crc = 0;
	starts[0] = mcap->at;
	for (int i = 0; i < mcap->n_channels; i++)
		write_schema(mcap, i);
	starts[1] = mcap->at;
	for (int i = 0; i < mcap->n_channels; i++)
		write_channel(mcap, i);
	starts[2] = mcap->at;
	write_statistics(mcap);
	starts[3] = mcap->at;
	write_bytes(mcap, mcap->chunk_indexes.data, mcap->chunk_indexes.n);
	starts[4] = mcap->at;
	write_bytes(mcap, mcap->metadata_index.data, mcap->metadata_index.n);
	starts[5] = mcap->at;
	for (int k = 0; k < 5; k++) {
		if (starts[k] == starts[k + 1])
			continue;
		to = begin_mcap(mcap, SUMMARY_OFFSET);
		put_mcap_number(to, order[k], 1);
		put_mcap_number(to, starts[k], 8);
		put_mcap_number(to, starts[k + 1] - starts[k], 8);
		end_mcap(mcap, NULL);
	}
	to = begin_mcap(mcap, FOOTER);
	put_mcap_number(to, starts[0], 8);
	put_mcap_number(to, starts[5], 8);
	put_mcap_number(to, 0, 4);
	close_length(to, 1, 8);
	if (to->failed)
		return;
	/* The checksum is over the whole summary but itself. */
	mcap->crc = (uint32_t)crc32_z(mcap->crc, to->data, to->n - 4);
	to->n -= 4;
	put_mcap_number(to, mcap->crc, 4);
	write_bytes(mcap, to->data, to->n);
}

int incise_mcap_finish(struct incise_mcap *mcap)
{
	struct incise_mcap_bytes *to;
	uint32_t crc;

	if (mcap->chunk.n)
		write_chunk(mcap);
	crc = mcap->crc;
	to = begin_mcap(mcap, DATA_END);
	put_mcap_number(to, crc, 4);
	end_mcap(mcap, NULL);
	write_summary(mcap);
	write_bytes(mcap, magic, sizeof(magic));
	errno = 0;
	if (!mcap->rc && fflush(mcap->out))
		mcap->rc = errno ? -errno : -EIO;
	return mcap->rc;
}

void incise_mcap_free(struct incise_mcap *mcap)
{
	for (int i = 0; i < mcap->n_channels; i++)
		free(mcap->channels[i].index.data);
	free(mcap->record.data);
	free(mcap->chunk.data);
	free(mcap->chunk_indexes.data);
	free(mcap->metadata_index.data);
}
