// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frames of a CAN bus for the CANopen master and the functions of a drive: nothing is read out of
 * bounds, and everything ends in bounded time.
 *
 *   input: the request (1 byte), then frames:
 *
 *   kind (1)   0 … 63    a good answer to the last SDO: 4 bytes, where it reads what was not
 *                        written just before
 *              64 … 127  some answer to it: command (1), 4 bytes
 *              128 … 191 any: id (2), length (1), 8 bytes
 *              192 … 223 of the node: function and length (1), 8 bytes
 *              224 … 239 an answer with any object: 8 bytes
 *              240 … 255 nothing for now
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/device/can/cia402/cia402.h"

#define NODE 0x10
#define OWN 0x7f
#define START_NS 1000000000LL
/*
 * Each request takes some hundred SDOs at most, and the first one without an answer ends
 * it: apart from some waits of 2 s, each is late by less than 200 ms.
 */
#define LIMIT_NS (60 * 1000000000LL)

struct fuzz_bus {
	struct can_bus bus;
	const uint8_t *data;
	size_t size;
	int64_t now_ns;
	uint8_t asked[8];   /* the last SDO */
	uint8_t written[8]; /* the last that wrote */
};

static struct fuzz_bus *of(struct can_bus *bus)
{
	return (struct fuzz_bus *)bus;
}

static int64_t bus_now(struct can_bus *bus)
{
	return of(bus)->now_ns;
}

static int bus_send(struct can_bus *bus, const struct can_frame *frame)
{
	if (frame->can_id == CANOPEN_SDO_REQUEST + NODE && frame->data[0] != 0x80 &&
	    frame->data[0] >> 5 != 3)
		memcpy(of(bus)->asked, frame->data, 8);
	if (frame->can_id == CANOPEN_SDO_REQUEST + NODE && frame->data[0] >> 5 == 1)
		memcpy(of(bus)->written, frame->data, 8);
	if (frame->len > 8 || frame->can_id & ~CAN_SFF_MASK)
		abort();
	return 0;
}

static void next(struct fuzz_bus *b, uint8_t *bytes, size_t n)
{
	size_t there = n < b->size ? n : b->size;

	memset(bytes, 0, n);
	memcpy(bytes, b->data, there);
	b->data += there;
	b->size -= there;
}

static int bus_receive(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	struct fuzz_bus *b = of(bus);
	uint8_t kind, head[3];

	if (!b->size)
		return 0;
	next(b, &kind, 1);
	if (kind >= 240)
		return 0;
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CANOPEN_SDO_ANSWER + NODE;
	frame->len = 8;
	if (kind < 128) {
		memcpy(frame->data + 1, b->asked + 1, 3);
		if (kind >= 64)
			next(b, frame->data, 1);
		else if (b->asked[0] >> 5 == 1)
			frame->data[0] = 0x60;
		else
			frame->data[0] = 0x42; /* of any size */
		if (kind < 64 && !memcmp(b->asked + 1, b->written + 1, 3))
			memcpy(frame->data + 4, b->written + 4, 4);
		else if (kind >= 64 || frame->data[0] == 0x42)
			next(b, frame->data + 4, 4);
	} else if (kind < 192) {
		next(b, head, 3);
		frame->can_id = (uint32_t)(head[0] | head[1] << 8) & CAN_SFF_MASK;
		frame->can_id |= (uint32_t)head[1] >> 3 << 27; /* flags, and beyond */
		frame->len = head[2];
		next(b, frame->data, 8);
	} else if (kind < 224) {
		next(b, head, 1);
		frame->can_id = ((uint32_t)head[0] >> 4 << 7) + NODE;
		frame->len = head[0] & 0xf;
		next(b, frame->data, 8);
	} else {
		next(b, frame->data, 8);
	}
	*t_ns = b->now_ns;
	return 1;
}

static int bus_wait(struct can_bus *bus, int64_t until_ns)
{
	struct fuzz_bus *b = of(bus);

	if (b->size && until_ns > b->now_ns + 100000)
		b->now_ns += 100000;
	else if (until_ns > b->now_ns)
		b->now_ns = until_ns;
	if (b->now_ns > START_NS + LIMIT_NS)
		abort();
	return 0;
}

static void handle_all(struct canopen *master)
{
	struct can_frame frame;
	uint32_t inputs;
	uint16_t word;
	int32_t position;
	int64_t t_ns;
	int mode = 0;

	while (of(master->bus)->size) {
		if (bus_receive(master->bus, &frame, &t_ns) <= 0)
			continue;
		canopen_handle(master, &frame, t_ns);
		if (cia402_parse_status(&frame, &word, &position, &mode))
			cia402_mode_name(mode);
		cia402_parse_inputs(&frame, &inputs);
	}
}

static void run(struct canopen *master, uint8_t request)
{
	const struct cia402_setup setup = {
		.mode = CIA402_CSP,
		.cycle_ns = 1000000,
		.deadman_ms = 100,
		.master = OWN,
		.heartbeat_ms = 20,
		.position_max = 1000,
		.velocity = 1,
		.acceleration = 1,
		.following = 1,
	};
	struct cia402_units units = {0};
	struct cia402_supported supported;
	struct incise_error err = {0};
	const struct cia402_client client = {master, "here", &err};
	char text[24];
	uint32_t value;
	bool homed;
	int rc = 0;

	switch (request & 7) {
	case 0:
		handle_all(master);
		break;
	case 1:
		canopen_read(master, 0x6064, 0, request & 8 ? 2 : 4, &value);
		break;
	case 2:
		rc = canopen_read_text(master, 0x1008, 0, text, sizeof(text));
		if (strlen(text) >= sizeof(text) || (rc && text[0]))
			abort();
		rc = 0;
		break;
	case 3:
		rc = cia402_identify(&client);
		break;
	case 4:
		rc = cia402_read_units(&client, &units);
		if (!rc &&
		    !(units.counts_per_turn >= 1 && units.velocity_per_turn_s > 0 &&
		      units.velocity_per_turn_s < 1e300 &&
		      units.acceleration_per_turn_s2 > 0 &&
		      units.acceleration_per_turn_s2 < 1e300))
			abort();
		break;
	case 5:
		rc = cia402_configure(&client, &setup, &supported);
		break;
	case 6:
		rc = cia402_clear(&client);
		break;
	case 7:
		rc = cia402_read_homed(&client, CIA402_CSP, &homed);
		break;
	}
	if (rc && (err.code != -rc || !err.text[0]))
		abort(); /* no line */
	canopen_emcy_text(master->emcy.code, text, sizeof(text));
	canopen_abort_text(master->abort, text, sizeof(text));
	canopen_state_name(master->state);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const struct can_bus_ops ops = {.now = bus_now,
					       .send = bus_send,
					       .receive = bus_receive,
					       .wait = bus_wait};
	struct fuzz_bus bus = {
		.bus = {.ops = &ops, .name = "fuzz"}, .data = data, .size = size};
	struct canopen master = {
		.bus = &bus.bus, .node = NODE, .own = OWN, .heartbeat_ns = 20000000};
	uint8_t request;

	bus.now_ns = START_NS;
	next(&bus, &request, 1);
	run(&master, request);
	return 0;
}
