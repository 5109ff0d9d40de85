// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is heard of a node and said to it, beside SDOs (canopen_sdo.c): heartbeats both ways,
 * NMT, EMCY, error frames. Times are ns of the bus's clock.
 *
 *   can_id  10 … 7   6 … 0
 *           function node
 */
#include <errno.h>
#include <string.h>
#include <linux/can/error.h>
#include "canopen.h"

#define NODE 0x7fu
#define MS_NS 1000000
/* Frames taken between two looks at the clock: a flood shall not hold anyone up. */
#define AT_ONCE 64

static uint32_t error_frame(struct canopen *master, const struct can_frame *frame)
{
	master->bus_error = frame->can_id & CAN_ERR_MASK;
	memset(master->bus_error_data, 0, sizeof(master->bus_error_data));
	memcpy(master->bus_error_data, frame->data,
	       frame->len < CAN_MAX_DLEN ? frame->len : CAN_MAX_DLEN);
	master->bus_offs += !!(frame->can_id & CAN_ERR_BUSOFF);
	return 0;
}

static void take_heartbeat(struct canopen *master, const struct can_frame *frame,
			   int64_t t_ns)
{
	uint8_t state = frame->data[0] & 0x7f; /* bit 7 toggles in node guarding */

	if (frame->len != 1)
		return;
	if (state != CANOPEN_BOOT_UP && state != CANOPEN_STOPPED &&
	    state != CANOPEN_OPERATIONAL && state != CANOPEN_PRE_OPERATIONAL)
		return;
	master->boots += state == CANOPEN_BOOT_UP;
	master->state = state;
	master->heard_ns = t_ns;
}

static void take_emcy(struct canopen *master, const struct can_frame *frame)
{
	struct canopen_emcy *emcy = &master->emcy;

	uint16_t code = (uint16_t)(frame->data[0] | frame->data[1] << 8);

	/* That it is over, often a ms later, must not hide what it was. */
	if (frame->len != 8 || !code)
		return;
	emcy->code = code;
	emcy->error_register = frame->data[2];
	memcpy(emcy->vendor, frame->data + 3, sizeof(emcy->vendor));
	emcy->count++;
}

static void take_answer(struct canopen *master, const struct can_frame *frame)
{
	struct canopen_answer *answer = &master->answer;
	bool abort = frame->data[0] == 0x80;

	if (!answer->wanted || answer->came || frame->len != 8)
		return;
	/* A segment does not say of what it is; all else does. */
	if (answer->segment && !abort) {
		if (frame->data[0] >> 5)
			return;
	} else if (memcmp(frame->data + 1, answer->object, sizeof(answer->object)) != 0) {
		return;
	}
	memcpy(answer->data, frame->data, sizeof(answer->data));
	answer->came = true;
}

uint32_t canopen_take(struct canopen *master, const struct can_frame *frame, int64_t t_ns)
{
	uint32_t id = frame->can_id, function = id & CAN_SFF_MASK & ~NODE;

	if (id & CAN_ERR_FLAG)
		return error_frame(master, frame);
	if (id & (CAN_EFF_FLAG | CAN_RTR_FLAG) || frame->len > CAN_MAX_DLEN)
		return 0;
	if (id == 0 || id == CANOPEN_SYNC ||
	    (master->own && id == (uint32_t)CANOPEN_HEARTBEAT + master->own))
		master->foreign++;
	if (id == CANOPEN_SYNC || (id & NODE) != master->node)
		return 0;
	switch (function) {
	case CANOPEN_EMCY:
		take_emcy(master, frame);
		return 0;
	case CANOPEN_HEARTBEAT:
		take_heartbeat(master, frame, t_ns);
		return 0;
	case 0x200:
	case 0x300:
	case 0x400:
	case 0x500: /* RPDO1 … RPDO4 */
		master->foreign++;
		return 0;
	case CANOPEN_SDO_ANSWER:
		take_answer(master, frame);
		return function;
	case CANOPEN_TPDO1:
	case CANOPEN_TPDO2:
	case 0x380:
	case 0x480: /* TPDO3, TPDO4 */
		return function;
	default:
		return 0;
	}
}

int canopen_beat(struct canopen *master, int64_t now_ns)
{
	struct can_frame frame = {.can_id = CANOPEN_HEARTBEAT + master->own, .len = 1};
	int rc;

	if (!master->own || master->beat_ns <= 0 || now_ns < master->next_beat_ns)
		return 0;
	frame.data[0] = CANOPEN_OPERATIONAL;
	rc = master->bus->ops->send(master->bus, &frame);
	if (rc)
		master->next_beat_ns = now_ns + MS_NS;
	else if (master->next_beat_ns > now_ns - master->beat_ns)
		master->next_beat_ns += master->beat_ns;
	else /* late by more than one: what was missed is not made up */
		master->next_beat_ns = now_ns + master->beat_ns;
	return rc;
}

int canopen_nmt(struct canopen *master, enum canopen_command command)
{
	struct can_frame frame = {.can_id = 0, .len = 2};

	frame.data[0] = (uint8_t)command;
	frame.data[1] = master->node;
	return master->bus->ops->send(master->bus, &frame);
}

/* Take what is there, but stop where it is @done. 1: done; 0; of the bus. */
static int take_all(struct canopen *master, bool (*done)(const struct canopen *master))
{
	struct can_frame frame;
	int64_t t_ns;
	int rc;

	for (int i = 0; i < AT_ONCE; i++) {
		if (done && done(master))
			return 1;
		rc = master->bus->ops->receive(master->bus, &frame, &t_ns);
		if (rc <= 0)
			return rc;
		canopen_take(master, &frame, t_ns);
	}
	return done && done(master);
}

int canopen_await(struct canopen *master, bool (*done)(const struct canopen *master),
		  int64_t until_ns)
{
	struct can_bus *bus = master->bus;

	for (;;) {
		int64_t now_ns = bus->ops->now(bus), wake_ns = until_ns;
		int rc = take_all(master, done);

		if (rc)
			return rc < 0 ? rc : 0;
		rc = canopen_beat(master, now_ns);
		if (rc && rc != -ENOBUFS)
			return rc;
		if (now_ns >= until_ns)
			return done ? -ETIMEDOUT : 0;
		if (master->own && master->beat_ns > 0 && master->next_beat_ns < wake_ns)
			wake_ns = master->next_beat_ns;
		rc = bus->ops->wait(bus, wake_ns);
		if (rc)
			return rc;
	}
}
