// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * SDO (CiA 301, 7.2.4): one object of a node read or written. Numbers are little-endian.
 *
 *   read    40 oo oo ss ........  ─▶  43|n oo oo ss vv vv vv vv    expedited
 *                                 ─▶  41   oo oo ss size           then segments:
 *           60|t ...............  ─▶  00|t|n|last  7 bytes
 *   write   23|n oo oo ss vv ...  ─▶  60   oo oo ss
 *   either                        ─▶  80   oo oo ss abort code
 */
#include <errno.h>
#include <string.h>
#include "canopen.h"

#define RETRY_NS 1000000 /* when the queue was full */

#define ABORT_TOGGLE 0x05030000
#define ABORT_TIMEOUT 0x05040000
#define ABORT_COMMAND 0x05040001
#define ABORT_MEMORY 0x05040005

#define SEGMENT 0x60
#define TOGGLE 0x10

static uint32_t get32(const uint8_t *bytes)
{
	return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
	       (uint32_t)bytes[3] << 24;
}

static void put32(uint8_t *bytes, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> 8 * i);
}

static void put_object(uint8_t *request, uint16_t index, uint8_t sub)
{
	request[1] = (uint8_t)index;
	request[2] = (uint8_t)(index >> 8);
	request[3] = sub;
}

static int put(struct canopen *master, const uint8_t request[8], int64_t until_ns)
{
	struct can_bus *bus = master->bus;
	struct can_frame frame = {.can_id = CANOPEN_SDO_REQUEST + master->node, .len = 8};
	int rc;

	memcpy(frame.data, request, 8);
	for (;;) {
		rc = bus->ops->send(bus, &frame);
		if (rc != -ENOBUFS)
			return rc;
		if (bus->ops->now(bus) >= until_ns)
			return -ENOBUFS;
		rc = canopen_await(master, NULL, bus->ops->now(bus) + RETRY_NS);
		if (rc)
			return rc;
	}
}

/* This side gives up. What the bus says of it changes nothing. */
static int give_up(struct canopen *master, const uint8_t object[3], uint32_t code, int rc)
{
	uint8_t request[8] = {0x80, object[0], object[1], object[2]};

	put32(request + 4, code);
	put(master, request, 0);
	return rc;
}

static bool answered(const struct canopen *master)
{
	return master->answer.came;
}

/* Ask, and have the answer in master->answer. @object: what it is all about. */
static int exchange(struct canopen *master, const uint8_t request[8],
		    const uint8_t object[3])
{
	struct can_bus *bus = master->bus;
	struct canopen_answer *answer = &master->answer;
	int64_t patience_ns =
		master->answer_ns > 0 ? master->answer_ns : CANOPEN_ANSWER_NS;
	/* What came before was asked before. */
	int rc = canopen_await(master, NULL, bus->ops->now(bus));

	if (rc)
		return rc;
	rc = put(master, request, bus->ops->now(bus) + patience_ns);
	if (rc)
		return rc;
	*answer = (struct canopen_answer){
		.wanted = true,
		.segment = (request[0] & 0xe0) == SEGMENT,
	};
	memcpy(answer->object, object, sizeof(answer->object));
	rc = canopen_await(master, answered, bus->ops->now(bus) + patience_ns);
	answer->wanted = false;
	if (rc == -ETIMEDOUT)
		return give_up(master, object, ABORT_TIMEOUT, rc);
	if (rc)
		return rc;
	if (answer->data[0] == 0x80) {
		master->abort = get32(answer->data + 4);
		return -EREMOTEIO;
	}
	return 0;
}

/* Segments into @bytes until the last; *@size: how many bytes. More than @room is cut. */
static int segments(struct canopen *master, const uint8_t object[3], uint8_t *bytes,
		    size_t room, size_t *size)
{
	uint8_t request[8] = {SEGMENT};
	const uint8_t *data = master->answer.data;
	bool last;

	*size = 0;
	do {
		size_t n;
		int rc = exchange(master, request, object);

		if (rc)
			return rc;
		if ((data[0] ^ request[0]) & TOGGLE)
			return give_up(master, object, ABORT_TOGGLE, -EPROTO);
		last = data[0] & 1;
		n = 7 - (data[0] >> 1 & 7);
		/* One that brings nothing and is not the last would go on for ever. */
		if (!n && !last)
			return give_up(master, object, ABORT_COMMAND, -EPROTO);
		if (n > room - *size)
			n = room - *size;
		memcpy(bytes + *size, data + 1, n);
		*size += n;
		request[0] ^= TOGGLE;
	} while (!last && *size < room);
	return last ? 0 : give_up(master, object, ABORT_MEMORY, 0);
}

static int upload(struct canopen *master, uint16_t index, uint8_t sub, uint8_t *bytes,
		  size_t room, size_t *size)
{
	uint8_t request[8] = {0x40};
	const uint8_t *data = master->answer.data;
	int rc;

	master->abort = 0;
	put_object(request, index, sub);
	rc = exchange(master, request, request + 1);
	if (rc)
		return rc;
	if (data[0] >> 5 != 2)
		return give_up(master, request + 1, ABORT_COMMAND, -EPROTO);
	if (!(data[0] & 2))
		return segments(master, request + 1, bytes, room, size);
	/* Expedited; without a size it is what the reader takes it for. */
	*size = data[0] & 1 ? 4 - (data[0] >> 2 & 3) : 4;
	if (!(data[0] & 1) && room < 4)
		*size = room;
	if (*size > room)
		return -EPROTO;
	memcpy(bytes, data + 4, *size);
	return 0;
}

int canopen_read(struct canopen *master, uint16_t index, uint8_t sub, int size,
		 uint32_t *value)
{
	uint8_t bytes[5] = {0}; /* one more, to see what is too long */
	size_t n = 0;
	int rc = upload(master, index, sub, bytes, sizeof(bytes), &n);

	if (rc)
		return rc;
	/* An expedited one without a size is of any. */
	if (n != (size_t)size && (master->answer.data[0] & 0xe3) != 0x42)
		return -EPROTO;
	*value = get32(bytes) & (size < 4 ? (1u << 8 * size) - 1 : UINT32_MAX);
	return 0;
}

int canopen_write(struct canopen *master, uint16_t index, uint8_t sub, int size,
		  uint32_t value)
{
	uint8_t request[8] = {(uint8_t)(0x23 | (4 - size) << 2)};
	int rc;

	master->abort = 0;
	put_object(request, index, sub);
	put32(request + 4, size < 4 ? value & ((1u << 8 * size) - 1) : value);
	rc = exchange(master, request, request + 1);
	if (rc)
		return rc;
	if (master->answer.data[0] >> 5 != 3)
		return give_up(master, request + 1, ABORT_COMMAND, -EPROTO);
	return 0;
}

int canopen_read_text(struct canopen *master, uint16_t index, uint8_t sub, char *text,
		      size_t size)
{
	uint8_t bytes[128];
	size_t n = 0, room = size - 1 < sizeof(bytes) ? size - 1 : sizeof(bytes);
	int rc;

	text[0] = '\0';
	rc = upload(master, index, sub, bytes, room, &n);
	if (rc)
		return rc;
	for (size_t i = 0; i < n && bytes[i]; i++) {
		text[i] = bytes[i] >= ' ' && bytes[i] < 0x7f ? (char)bytes[i] : '?';
		text[i + 1] = '\0';
	}
	return 0;
}
