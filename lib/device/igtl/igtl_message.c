// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages of OpenIGTLink; see igtl_message.h.
 */
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <openigtlink/igtl_util.h>
#include "igtl_message.h"

#define SECOND_NS 1000000000ULL
#define US_ASCII 3 /* number of IANA */

/* A table of metadata: the number of pairs, then for each the sizes of key and value. */
struct pair_sizes {
	uint16_t key_n, encoding;
	uint32_t value_n;
} __attribute__((packed));

struct extended_header {
	uint16_t own_n, table_n;
	uint32_t pairs_n, id;
} __attribute__((packed));

_Static_assert(sizeof(struct extended_header) == INCISE_IGTL_EXTENDED, "as on the wire");
_Static_assert(sizeof(igtl_header) == IGTL_HEADER_SIZE, "as on the wire");

uint64_t incise_igtl_time(int64_t utc_ns)
{
	uint64_t s, ns;

	if (utc_ns < 0 || (uint64_t)utc_ns / SECOND_NS > UINT32_MAX)
		return 0;
	s = (uint64_t)utc_ns / SECOND_NS;
	ns = (uint64_t)utc_ns % SECOND_NS;
	/* 999 999 999 ns round to 2^32 - 4: no carry. */
	return s << 32 | ((ns << 32) + SECOND_NS / 2) / SECOND_NS;
}

int64_t incise_igtl_time_ns(uint64_t time)
{
	uint64_t ns = ((time & UINT32_MAX) * SECOND_NS + (1ULL << 31)) >> 32;

	return (int64_t)((time >> 32) * SECOND_NS + ns);
}

void incise_igtl_name(char *to, const char *from, size_t size)
{
	size_t n = strnlen(from, size);

	for (size_t i = 0; i < n; i++)
		to[i] = (char)(from[i] < ' ' || from[i] > '~' ? '?' : from[i]);
	to[n] = '\0';
}

/* --- packing ------------------------------------------------------------------------- */

/* Returns what follows. */
static uint8_t *put_bytes(uint8_t *to, const void *from, size_t n)
{
	if (n)
		memcpy(to, from, n);
	return to + n;
}

static size_t sum_pairs(const struct incise_igtl_label *label)
{
	size_t n = 0;

	for (int i = 0; i < label->n_metadata; i++)
		n += strlen(label->metadata[i][0]) + strlen(label->metadata[i][1]);
	return n;
}

static void put_metadata(uint8_t *to, const struct incise_igtl_label *label)
{
	uint16_t n = htobe16((uint16_t)label->n_metadata);

	to = put_bytes(to, &n, sizeof(n));
	for (int i = 0; i < label->n_metadata; i++) {
		const char *const *pair = label->metadata[i];
		struct pair_sizes sizes = {htobe16((uint16_t)strlen(pair[0])),
					   htobe16(US_ASCII),
					   htobe32((uint32_t)strlen(pair[1]))};

		to = put_bytes(to, &sizes, sizeof(sizes));
	}
	for (int i = 0; i < 2 * label->n_metadata; i++)
		to = put_bytes(to, label->metadata[i / 2][i % 2],
			       strlen(label->metadata[i / 2][i % 2]));
}

ssize_t incise_igtl_pack(void *bytes, size_t capacity,
			 const struct incise_igtl_label *label, const void *head,
			 size_t head_n, const void *content, size_t n)
{
	bool extends = label->version > 1;
	size_t extended_n = extends ? INCISE_IGTL_EXTENDED : 0;
	size_t table_n =
		extends ? 2 + (size_t)label->n_metadata * sizeof(struct pair_sizes) : 0;
	size_t pairs_n = extends ? sum_pairs(label) : 0;
	size_t body_n = extended_n + head_n + n + table_n + pairs_n;
	const struct extended_header extended = {htobe16(INCISE_IGTL_EXTENDED),
						 htobe16((uint16_t)table_n),
						 htobe32((uint32_t)pairs_n),
						 htobe32(label->id)};
	igtl_header header = {.version = (uint16_t)label->version,
			      .timestamp =
				      label->utc_ns ? incise_igtl_time(label->utc_ns) : 0,
			      .body_size = body_n};
	uint8_t *body = (uint8_t *)bytes + IGTL_HEADER_SIZE, *at;

	if (capacity < IGTL_HEADER_SIZE + body_n)
		return -ENOBUFS;
	at = put_bytes(body, &extended, extended_n);
	at = put_bytes(at, head, head_n);
	at = put_bytes(at, content, n);
	if (extends)
		put_metadata(at, label);
	/* Without a zero at their end if they are as long as their fields. */
	put_bytes((uint8_t *)header.name, label->type,
		  strnlen(label->type, sizeof(header.name)));
	put_bytes((uint8_t *)header.device_name, label->name,
		  strnlen(label->name, sizeof(header.device_name)));
	header.crc = crc64(body, body_n, 0);
	igtl_header_convert_byte_order(&header);
	memcpy(bytes, &header, sizeof(header));
	return (ssize_t)(IGTL_HEADER_SIZE + body_n);
}

/* --- parsing ------------------------------------------------------------------------- */

/* The header, and the size of the body. -EPROTO: it is none. */
static int parse_header(const uint8_t *bytes, struct incise_igtl_message *message,
			igtl_header *header)
{
	memcpy(header, bytes, sizeof(*header));
	igtl_header_convert_byte_order(header);
	memset(message, 0, sizeof(*message));
	message->version = header->version;
	if (message->version < 1 || message->version > 2)
		return -EPROTO;
	incise_igtl_name(message->type, header->name, sizeof(header->name));
	if (!*message->type || strchr(message->type, '?'))
		return -EPROTO;
	incise_igtl_name(message->name, header->device_name, sizeof(header->device_name));
	message->utc_ns = incise_igtl_time_ns(header->timestamp);
	return 0;
}

static struct pair_sizes pair_sizes_of(const struct incise_igtl_message *message, int i)
{
	struct pair_sizes sizes;

	memcpy(&sizes, message->metadata + 2 + (size_t)i * sizeof(sizes), sizeof(sizes));
	return (struct pair_sizes){be16toh(sizes.key_n), 0, be32toh(sizes.value_n)};
}

/* The table, and whether sizes of keys and values fill the @pairs_n bytes behind it exactly. */
static int parse_metadata(struct incise_igtl_message *message, size_t table_n,
			  size_t pairs_n)
{
	uint64_t sum = 0;
	uint16_t n;

	if (!table_n)
		return pairs_n ? -EPROTO : 0;
	if (table_n < sizeof(n))
		return -EPROTO;
	memcpy(&n, message->metadata, sizeof(n));
	message->n_metadata = be16toh(n);
	if (table_n !=
	    sizeof(n) + (size_t)message->n_metadata * sizeof(struct pair_sizes))
		return -EPROTO;
	for (int i = 0; i < message->n_metadata; i++) {
		struct pair_sizes sizes = pair_sizes_of(message, i);

		sum += sizes.key_n + (uint64_t)sizes.value_n;
	}
	return sum == pairs_n ? 0 : -EPROTO;
}

/* Content and metadata of a body whose CRC is right. */
static int parse_body(const uint8_t *body, size_t n, struct incise_igtl_message *message)
{
	struct extended_header extended;
	size_t own_n, table_n, pairs_n;

	message->content = body;
	message->n = n;
	if (message->version == 1)
		return 0;
	if (n < sizeof(extended))
		return -EPROTO;
	memcpy(&extended, body, sizeof(extended));
	/* A longer one may come: its end is skipped. */
	own_n = be16toh(extended.own_n);
	table_n = be16toh(extended.table_n);
	pairs_n = be32toh(extended.pairs_n);
	if (own_n < sizeof(extended) || own_n > n || n - own_n < table_n ||
	    n - own_n - table_n < pairs_n)
		return -EPROTO;
	message->id = be32toh(extended.id);
	message->content = body + own_n;
	message->n = n - own_n - table_n - pairs_n;
	message->metadata = message->content + message->n;
	return parse_metadata(message, table_n, pairs_n);
}

int incise_igtl_metadata(const struct incise_igtl_message *message, int i,
			 struct incise_igtl_pair *pair)
{
	const uint8_t *at;
	struct pair_sizes sizes;

	if (i < 0 || i >= message->n_metadata)
		return -ENOENT;
	at = message->metadata + 2 + (size_t)message->n_metadata * sizeof(sizes);
	for (int k = 0; k < i; k++) {
		sizes = pair_sizes_of(message, k);
		at += sizes.key_n + (size_t)sizes.value_n;
	}
	sizes = pair_sizes_of(message, i);
	*pair = (struct incise_igtl_pair){.key = (const char *)at,
					  .key_n = sizes.key_n,
					  .value = (const char *)at + sizes.key_n,
					  .value_n = sizes.value_n};
	return 0;
}
/* --- streams ------------------------------------------------------------------------- */

struct incise_igtl_stream {
	size_t body_max;
	uint8_t *bytes; /* of the message that arrives */
	size_t n, capacity;
	uint64_t skip; /* bytes of a body to pass over */
	bool lost;
};

#define FIRST_CAPACITY 1024

struct incise_igtl_stream *incise_igtl_stream_new(size_t body_max)
{
	struct incise_igtl_stream *stream = calloc(1, sizeof(*stream));

	if (!stream)
		return NULL;
	stream->body_max = body_max < SIZE_MAX / 4 ? body_max : SIZE_MAX / 4;
	stream->bytes = malloc(FIRST_CAPACITY);
	stream->capacity = FIRST_CAPACITY;
	if (!stream->bytes) {
		free(stream);
		errno = ENOMEM;
		return NULL;
	}
	return stream;
}

/* Take bytes until there are @want of the message. 1: they are there; 0: not yet; -ENOMEM. */
static int collect_bytes(struct incise_igtl_stream *stream, size_t want,
			 const uint8_t **bytes, size_t *n)
{
	size_t take = want - stream->n < *n ? want - stream->n : *n;

	if (stream->n + take > stream->capacity) {
		size_t capacity = 2 * stream->capacity;
		uint8_t *more;

		/* Twice what is there, whatever is announced. */
		while (capacity < stream->n + take)
			capacity *= 2;
		more = realloc(stream->bytes, capacity);
		if (!more)
			return -ENOMEM;
		stream->bytes = more;
		stream->capacity = capacity;
	}
	put_bytes(stream->bytes + stream->n, *bytes, take);
	stream->n += take;
	*bytes += take;
	*n -= take;
	return stream->n == want;
}

/* Pass over what is left of a body of @body bytes. */
static void skip_body(struct incise_igtl_stream *stream, uint64_t body)
{
	stream->skip = body - (stream->n - IGTL_HEADER_SIZE);
	stream->n = 0;
}

int incise_igtl_stream_next(struct incise_igtl_stream *stream, const uint8_t **bytes,
			    size_t *n, struct incise_igtl_message *message)
{
	igtl_header header;
	uint8_t *body;
	size_t skip;
	int status;

	if (stream->lost)
		return -EPROTO;
	skip = stream->skip < *n ? (size_t)stream->skip : *n;
	stream->skip -= skip;
	*bytes += skip;
	*n -= skip;
	if (stream->skip)
		return 0;
	if (stream->n < IGTL_HEADER_SIZE) {
		status = collect_bytes(stream, IGTL_HEADER_SIZE, bytes, n);
		if (status <= 0)
			return status;
	}
	status = parse_header(stream->bytes, message, &header);
	if (status) {
		stream->lost = true;
		return status;
	}
	status = -EMSGSIZE;
	if (header.body_size <= stream->body_max)
		status = collect_bytes(
			stream, IGTL_HEADER_SIZE + (size_t)header.body_size, bytes, n);
	if (!status)
		return 0;
	if (status < 0) {
		skip_body(stream, header.body_size);
		return status;
	}
	stream->n = 0;
	body = stream->bytes + IGTL_HEADER_SIZE;
	if (crc64(body, header.body_size, 0) != header.crc)
		return -EBADMSG;
	status = parse_body(body, (size_t)header.body_size, message);
	if (status == -EPROTO)
		stream->lost = true;
	return status ? status : 1;
}

bool incise_igtl_stream_inside(const struct incise_igtl_stream *stream)
{
	return stream->n || stream->skip;
}

void incise_igtl_stream_free(struct incise_igtl_stream *stream)
{
	if (!stream)
		return;
	free(stream->bytes);
	free(stream);
}
