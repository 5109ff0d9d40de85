// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of a network for the reader of OpenIGTLink under libFuzzer: nothing is read out of
 * bounds, however they are cut, and a message that is found is packed to the same bytes.
 *
 *   input: size of the parts that arrive (1), flags (1), then bytes. With flag 1 the CRC of each
 *   body is made right, since a fuzzer finds none by chance.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <openigtlink/igtl_util.h>
#include "../../lib/device/igtl/igtl_message.h"

#define BODY_MAX 1000

static void wrong(const char *what)
{
	fprintf(stderr, "igtl_stream: %s\n", what);
	abort();
}

/* Make the CRCs right, as far as headers are. */
static void mend(uint8_t *bytes, size_t n)
{
	while (n > IGTL_HEADER_SIZE) {
		uint64_t body = 0, crc;

		for (int i = 0; i < 8; i++)
			body = body << 8 | bytes[42 + i];
		if (body > n - IGTL_HEADER_SIZE)
			return;
		crc = crc64(bytes + IGTL_HEADER_SIZE, body, 0);
		for (int i = 0; i < 8; i++)
			bytes[50 + i] = (uint8_t)(crc >> (56 - 8 * i));
		bytes += IGTL_HEADER_SIZE + body;
		n -= IGTL_HEADER_SIZE + body;
	}
}

static unsigned int sum(const void *bytes, size_t n)
{
	const uint8_t *byte = bytes;
	unsigned int total = 0;

	while (n--)
		total += *byte++;
	return total;
}

static volatile unsigned int touched;

/* Read all that it holds; without its metadata it is packed to what is read as the same. */
static void read_all(const struct incise_igtl_message *message)
{
	uint8_t packed[IGTL_HEADER_SIZE + BODY_MAX];
	struct incise_igtl_label label = {.version = message->version,
					  .type = message->type,
					  .name = message->name,
					  .utc_ns = message->utc_ns,
					  .id = message->id};
	struct incise_igtl_stream *stream;
	struct incise_igtl_message again;
	struct incise_igtl_pair pair;
	const uint8_t *at = packed;
	ssize_t size;
	size_t n;

	touched += sum(message->content, message->n);
	for (int i = 0; !incise_igtl_metadata(message, i, &pair); i++)
		touched += sum(pair.key, pair.key_n) + sum(pair.value, pair.value_n);
	size = incise_igtl_pack(packed, sizeof(packed), &label, NULL, 0, message->content,
				message->n);
	/* It is smaller, but has two bytes that say so. */
	if (INCISE_IGTL_EXTENDED + message->n + 2 > BODY_MAX)
		return;
	n = size > 0 ? (size_t)size : 0;
	stream = incise_igtl_stream_new(BODY_MAX);
	if (incise_igtl_stream_next(stream, &at, &n, &again) != 1 ||
	    again.n != message->n || memcmp(again.content, message->content, again.n) ||
	    strcmp(again.type, message->type) || strcmp(again.name, message->name))
		wrong("it is packed in another way than it is read");
	incise_igtl_stream_free(stream);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_igtl_stream *stream = incise_igtl_stream_new(BODY_MAX);
	struct incise_igtl_message message;
	size_t part, n, left;
	uint8_t *bytes;
	int calls = 0;

	if (size < 2) {
		incise_igtl_stream_free(stream);
		return 0;
	}
	part = data[0] ? data[0] : 1;
	n = size - 2;
	bytes = malloc(n + 1);
	memcpy(bytes, data + 2, n);
	if (data[1] & 1)
		mend(bytes, n);
	for (size_t at = 0; at < n; at += part) {
		/* A copy of its own, so that the sanitizer watches its end. */
		size_t here = part < n - at ? part : n - at;
		uint8_t *arrived = malloc(here);
		const uint8_t *next = arrived;
		int found;

		memcpy(arrived, bytes + at, here);
		left = here;
		do {
			found = incise_igtl_stream_next(stream, &next, &left, &message);
			if (found == 1)
				read_all(&message);
			/* Each result but the last belongs to a header. */
			if (++calls > (int)(2 * n / IGTL_HEADER_SIZE + 2 * n / part) + 9)
				wrong("it does not go on");
		} while (found && found != -EPROTO);
		if (!found && left)
			wrong("bytes are left over");
		free(arrived);
	}
	free(bytes);
	incise_igtl_stream_free(stream);
	return 0;
}
