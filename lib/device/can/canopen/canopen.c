// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A CANopen master for one node; see canopen.h. Times are ns of the bus's clock. The length of a
 * frame is can_dlc: headers before Linux 5.11 have no other name for it.
 *
 *   can_id  10 … 7   6 … 0
 *           function node
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <linux/can/error.h>
#include "canopen.h"

#define NODE 0x7fu
#define RETRY_NS 1000000 /* after the queue was full */
#define FRAMES_MAX \
	64 /* handled between two looks at the clock, so that a flood delays nothing */

#define ABORT_TOGGLE 0x05030000
#define ABORT_TIMEOUT 0x05040000
#define ABORT_COMMAND 0x05040001
#define ABORT_MEMORY 0x05040005

#define SEGMENT 0x60
#define TOGGLE 0x10

void canopen_pack(uint8_t *bytes, int n, uint32_t value)
{
	for (int i = 0; i < n; i++)
		bytes[i] = (uint8_t)(value >> 8 * i);
}

uint32_t canopen_unpack(const uint8_t *bytes, int n)
{
	uint32_t value = 0;

	for (int i = 0; i < n; i++)
		value |= (uint32_t)bytes[i] << 8 * i;
	return value;
}

/* --- frames of the node, heartbeats, NMT --- */

static void handle_heartbeat(struct canopen *master, const struct can_frame *frame,
			     int64_t t_ns)
{
	uint8_t state = frame->data[0] & 0x7f; /* bit 7 toggles in node guarding */

	if (frame->can_dlc != 1)
		return;
	if (state != CANOPEN_BOOT_UP && state != CANOPEN_STOPPED &&
	    state != CANOPEN_OPERATIONAL && state != CANOPEN_PRE_OPERATIONAL)
		return;
	master->boots += state == CANOPEN_BOOT_UP;
	master->state = state;
	master->last_heartbeat_ns = t_ns;
}

static void handle_emcy(struct canopen *master, const struct can_frame *frame)
{
	struct canopen_emcy *emcy = &master->emcy;
	uint16_t code = (uint16_t)(frame->data[0] | frame->data[1] << 8);

	/* The end of an error, often a ms later, must not hide the error. */
	if (frame->can_dlc != 8 || !code)
		return;
	emcy->code = code;
	emcy->error_register = frame->data[2];
	emcy->count++;
}

static void handle_answer(struct canopen *master, const struct can_frame *frame)
{
	struct canopen_answer *answer = &master->answer;
	bool abort = frame->data[0] == 0x80;

	if (!answer->wanted || answer->received || frame->can_dlc != 8)
		return;
	/* A segment does not name its object; all other answers do. */
	if (answer->segment && !abort) {
		if (frame->data[0] >> 5)
			return;
	} else if (memcmp(frame->data + 1, answer->object, sizeof(answer->object)) != 0) {
		return;
	}
	memcpy(answer->data, frame->data, sizeof(answer->data));
	answer->received = true;
}

uint32_t canopen_handle(struct canopen *master, const struct can_frame *frame,
			int64_t t_ns)
{
	uint32_t id = frame->can_id, function = id & CAN_SFF_MASK & ~NODE;

	if (id & CAN_ERR_FLAG) {
		master->bus_offs += !!(id & CAN_ERR_BUSOFF);
		return 0;
	}
	if (id & (CAN_EFF_FLAG | CAN_RTR_FLAG) || frame->can_dlc > CAN_MAX_DLEN)
		return 0;
	if (id == 0 || id == CANOPEN_SYNC ||
	    (master->own && id == (uint32_t)CANOPEN_HEARTBEAT + master->own))
		master->foreign++;
	if (id == CANOPEN_SYNC || (id & NODE) != master->node)
		return 0;
	switch (function) {
	case CANOPEN_EMCY:
		handle_emcy(master, frame);
		return 0;
	case CANOPEN_HEARTBEAT:
		handle_heartbeat(master, frame, t_ns);
		return 0;
	case 0x200:
	case 0x300:
	case 0x400:
	case 0x500: /* RPDO1 … RPDO4 */
		master->foreign++;
		return 0;
	case CANOPEN_SDO_ANSWER:
		handle_answer(master, frame);
		return function;
	case CANOPEN_SDO_REQUEST:
		master->echoes +=
			frame->can_dlc == 8 && !memcmp(frame->data, master->request, 8);
		return 0;
	case CANOPEN_TPDO1:
	case CANOPEN_TPDO2:
	case 0x380:
	case 0x480: /* TPDO3, TPDO4 */
		return function;
	default:
		return 0;
	}
}

int canopen_send_heartbeat(struct canopen *master, int64_t now_ns)
{
	struct can_frame frame = {.can_id = CANOPEN_HEARTBEAT + master->own,
				  .can_dlc = 1};
	int rc;

	if (!master->own || master->heartbeat_ns <= 0 ||
	    now_ns < master->next_heartbeat_ns)
		return 0;
	frame.data[0] = CANOPEN_OPERATIONAL;
	rc = master->bus->ops->send(master->bus, &frame);
	if (rc)
		master->next_heartbeat_ns = now_ns + RETRY_NS;
	else if (master->next_heartbeat_ns > now_ns - master->heartbeat_ns)
		master->next_heartbeat_ns += master->heartbeat_ns;
	else /* late by more than one: missed ones are not made up for */
		master->next_heartbeat_ns = now_ns + master->heartbeat_ns;
	return rc;
}

bool canopen_is_operational(const struct canopen *master)
{
	return master->state == CANOPEN_OPERATIONAL;
}

int canopen_send_nmt(struct canopen *master, enum canopen_command command)
{
	struct can_frame frame = {.can_id = 0, .can_dlc = 2};

	frame.data[0] = (uint8_t)command;
	frame.data[1] = master->node;
	return master->bus->ops->send(master->bus, &frame);
}

/* Handle queued frames until @done. Returns 1: done; 0; an error of the bus. */
static int handle_frames(struct canopen *master,
			 bool (*done)(const struct canopen *master))
{
	struct can_frame frame;
	int64_t t_ns;
	int rc;

	for (int i = 0; i < FRAMES_MAX; i++) {
		if (done && done(master))
			return 1;
		rc = master->bus->ops->receive(master->bus, &frame, &t_ns);
		if (rc <= 0)
			return rc;
		canopen_handle(master, &frame, t_ns);
	}
	return done && done(master);
}

int canopen_await(struct canopen *master, bool (*done)(const struct canopen *master),
		  int64_t until_ns)
{
	struct can_bus *bus = master->bus;

	for (;;) {
		int64_t now_ns = bus->ops->now(bus), wake_ns = until_ns;
		int rc = handle_frames(master, done);

		if (rc)
			return rc < 0 ? rc : 0;
		rc = canopen_send_heartbeat(master, now_ns);
		if (rc && rc != -ENOBUFS)
			return rc;
		if (now_ns >= until_ns)
			return done ? -ETIMEDOUT : 0;
		if (master->own && master->heartbeat_ns > 0 &&
		    master->next_heartbeat_ns < wake_ns)
			wake_ns = master->next_heartbeat_ns;
		rc = bus->ops->wait(bus, wake_ns);
		if (rc)
			return rc;
	}
}

/*
 * --- SDO (CiA 301, 7.2.4): read or write one object of a node; little-endian ---
 *
 *   read    40 oo oo ss ........  ─▶  43|n oo oo ss vv vv vv vv    expedited
 *                                 ─▶  41   oo oo ss size           then segments:
 *           60|t ...............  ─▶  00|t|n|last  7 bytes
 *   write   23|n oo oo ss vv ...  ─▶  60   oo oo ss
 *   either                        ─▶  80   oo oo ss abort code
 */

static void set_object(uint8_t *request, uint16_t index, uint8_t sub)
{
	request[1] = (uint8_t)index;
	request[2] = (uint8_t)(index >> 8);
	request[3] = sub;
}

static int send_request(struct canopen *master, const uint8_t request[8],
			int64_t until_ns)
{
	struct can_bus *bus = master->bus;
	struct can_frame frame = {.can_id = CANOPEN_SDO_REQUEST + master->node,
				  .can_dlc = 8};
	int rc;

	memcpy(frame.data, request, 8);
	memcpy(master->request, request, 8);
	master->requests++;
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

/* Abort from this side; errors of the bus no longer matter. Returns @rc. */
static int abort_transfer(struct canopen *master, const uint8_t object[3], uint32_t code,
			  int rc)
{
	uint8_t request[8] = {0x80, object[0], object[1], object[2]};

	canopen_pack(request + 4, 4, code);
	send_request(master, request, 0);
	return rc;
}

static bool answered(const struct canopen *master)
{
	return master->answer.received;
}

/* Send a request and receive master->answer. @object: the object of the transfer. */
static int exchange(struct canopen *master, const uint8_t request[8],
		    const uint8_t object[3])
{
	struct can_bus *bus = master->bus;
	struct canopen_answer *answer = &master->answer;
	int64_t timeout_ns =
		master->answer_ns > 0 ? master->answer_ns : CANOPEN_ANSWER_NS;
	int64_t sent_ns;
	/* Earlier answers belong to earlier requests. */
	int rc = canopen_await(master, NULL, bus->ops->now(bus));

	master->late_ns = 0;
	if (rc)
		return rc;
	rc = send_request(master, request, bus->ops->now(bus) + timeout_ns);
	if (rc)
		return rc;
	*answer = (struct canopen_answer){
		.wanted = true,
		.segment = (request[0] & 0xe0) == SEGMENT,
	};
	memcpy(answer->object, object, sizeof(answer->object));
	sent_ns = bus->ops->now(bus);
	rc = canopen_await(master, answered, sent_ns + timeout_ns);
	/* A slow node is not an absent one. */
	if (rc == -ETIMEDOUT &&
	    !canopen_await(master, answered, sent_ns + timeout_ns + CANOPEN_LATE_NS))
		master->late_ns = bus->ops->now(bus) - sent_ns;
	answer->wanted = false;
	if (rc == -ETIMEDOUT)
		return abort_transfer(master, object, ABORT_TIMEOUT, rc);
	if (rc)
		return rc;
	if (answer->data[0] == 0x80) {
		master->abort = canopen_unpack(answer->data + 4, 4);
		return -EREMOTEIO;
	}
	return 0;
}

/* Read segments until the last one; *@size: how many bytes. Cuts to @capacity. */
static int read_segments(struct canopen *master, const uint8_t object[3], uint8_t *bytes,
			 size_t capacity, size_t *size)
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
			return abort_transfer(master, object, ABORT_TOGGLE, -EPROTO);
		last = data[0] & 1;
		n = 7 - (data[0] >> 1 & 7);
		/* Empty segments before the last one could go on for ever. */
		if (!n && !last)
			return abort_transfer(master, object, ABORT_COMMAND, -EPROTO);
		if (n > capacity - *size)
			n = capacity - *size;
		memcpy(bytes + *size, data + 1, n);
		*size += n;
		request[0] ^= TOGGLE;
	} while (!last && *size < capacity);
	return last ? 0 : abort_transfer(master, object, ABORT_MEMORY, 0);
}

static int upload(struct canopen *master, uint16_t index, uint8_t sub, uint8_t *bytes,
		  size_t capacity, size_t *size)
{
	uint8_t request[8] = {0x40};
	const uint8_t *data = master->answer.data;
	int rc;

	master->abort = 0;
	set_object(request, index, sub);
	rc = exchange(master, request, request + 1);
	if (rc)
		return rc;
	if (data[0] >> 5 != 2)
		return abort_transfer(master, request + 1, ABORT_COMMAND, -EPROTO);
	if (!(data[0] & 2))
		return read_segments(master, request + 1, bytes, capacity, size);
	/* Expedited; without a size it is as long as the caller expects. */
	*size = data[0] & 1 ? 4 - (data[0] >> 2 & 3) : 4;
	if (!(data[0] & 1) && capacity < 4)
		*size = capacity;
	if (*size > capacity)
		return -EPROTO;
	memcpy(bytes, data + 4, *size);
	return 0;
}

int canopen_read(struct canopen *master, uint16_t index, uint8_t sub, int size,
		 uint32_t *value)
{
	uint8_t bytes[5] = {0}; /* one more, to detect a longer object */
	size_t n = 0;
	int rc = upload(master, index, sub, bytes, sizeof(bytes), &n);

	if (rc)
		return rc;
	/* An expedited answer without a size fits any. */
	if (n != (size_t)size && (master->answer.data[0] & 0xe3) != 0x42)
		return -EPROTO;
	*value =
		canopen_unpack(bytes, 4) & (size < 4 ? (1u << 8 * size) - 1 : UINT32_MAX);
	return 0;
}

int canopen_write(struct canopen *master, uint16_t index, uint8_t sub, int size,
		  uint32_t value)
{
	uint8_t request[8] = {(uint8_t)(0x23 | (4 - size) << 2)};
	int rc;

	master->abort = 0;
	set_object(request, index, sub);
	canopen_pack(request + 4, 4, size < 4 ? value & ((1u << 8 * size) - 1) : value);
	rc = exchange(master, request, request + 1);
	if (rc)
		return rc;
	if (master->answer.data[0] >> 5 != 3)
		return abort_transfer(master, request + 1, ABORT_COMMAND, -EPROTO);
	return 0;
}

int canopen_read_text(struct canopen *master, uint16_t index, uint8_t sub, char *text,
		      size_t size)
{
	uint8_t bytes[128];
	size_t n = 0, capacity = size - 1 < sizeof(bytes) ? size - 1 : sizeof(bytes);
	int rc;

	text[0] = '\0';
	rc = upload(master, index, sub, bytes, capacity, &n);
	if (rc)
		return rc;
	for (size_t i = 0; i < n && bytes[i]; i++) {
		text[i] = bytes[i] >= ' ' && bytes[i] < 0x7f ? (char)bytes[i] : '?';
		text[i + 1] = '\0';
	}
	return 0;
}

/*
 * --- numbers in words: SDO abort codes (CiA 301, table 22), error codes of EMCYs (CiA 301,
 * table 26; for drives: CiA 402-2 by IEC 61800-7-201), NMT states ---
 */

struct code_text {
	uint32_t code;
	const char *text;
};

/* By rising code. */
static const struct code_text aborts[] = {
	{0x05030000, "toggle bit not alternated"},
	{0x05040000, "SDO protocol timed out"},
	{0x05040001, "command specifier not valid or unknown"},
	{0x05040002, "invalid block size"},
	{0x05040003, "invalid sequence number"},
	{0x05040004, "CRC error"},
	{0x05040005, "out of memory"},
	{0x06010000, "unsupported access to an object"},
	{0x06010001, "attempt to read a write-only object"},
	{0x06010002, "attempt to write a read-only object"},
	{0x06020000, "object does not exist"},
	{0x06040041, "object cannot be mapped to the PDO"},
	{0x06040042, "mapped objects would be longer than a PDO"},
	{0x06040043, "general parameter incompatibility"},
	{0x06040047, "general internal incompatibility in the device"},
	{0x06060000, "access failed due to a hardware error"},
	{0x06070010, "data type or length does not match"},
	{0x06070012, "data type does not match: too long"},
	{0x06070013, "data type does not match: too short"},
	{0x06090011, "sub-index does not exist"},
	{0x06090030, "invalid value"},
	{0x06090031, "value too high"},
	{0x06090032, "value too low"},
	{0x06090036, "maximum is less than minimum"},
	{0x060a0023, "resource not available: SDO connection"},
	{0x08000000, "general error"},
	{0x08000020, "data cannot be transferred or stored"},
	{0x08000021, "data cannot be transferred or stored: local control"},
	{0x08000022, "data cannot be transferred or stored in this state of the device"},
	{0x08000023, "no object dictionary is present"},
	{0x08000024, "no data available"},
};

/* By falling code; xx00 and x000 are classes. */
static const struct code_text emcys[] = {
	{0xff00, "fault of the manufacturer's own"},
	{0xf000, "additional functions"},
	{0x9000, "external error"},
	{0x8a00, "not stopped at the limit"},
	{0x8900, "speed of the motors is not the same"},
	{0x8612, "reference limit"},
	{0x8611, "following error too large"},
	{0x8600, "positioning controller"},
	{0x8500, "torque controller, overshoot"},
	{0x8480, "speed too high or too low"},
	{0x8400, "velocity controller"},
	{0x8331, "torque fault"},
	{0x8313, "standstill torque"},
	{0x8312, "difficult start-up"},
	{0x8311, "excess torque"},
	{0x8300, "torque control"},
	{0x8250, "RPDO time-out: setpoints stopped"},
	{0x8240, "unexpected length of SYNC"},
	{0x8230, "destination of a multiplexed PDO not available"},
	{0x8220, "PDO length exceeded"},
	{0x8210, "PDO not processed: wrong length"},
	{0x8200, "protocol error"},
	{0x8150, "CAN-ID collision"},
	{0x8140, "recovered from bus-off"},
	{0x8130, "life guard or heartbeat error"},
	{0x8120, "CAN in error passive mode"},
	{0x8110, "CAN overrun: frames lost"},
	{0x8100, "communication"},
	{0x8000, "monitoring"},
	{0x7600, "data storage"},
	{0x7510, "serial interface"},
	{0x7500, "communication inside the drive"},
	{0x7400, "computation circuit"},
	{0x7320, "position sensor"},
	{0x7310, "speed sensor"},
	{0x7306, "incremental sensor 2"},
	{0x7305, "incremental sensor 1"},
	{0x7304, "resolver 2"},
	{0x7303, "resolver 1"},
	{0x7302, "tacho with wrong polarity"},
	{0x7301, "tacho"},
	{0x7300, "sensor"},
	{0x7200, "measurement circuit"},
	{0x7122, "motor or commutation malfunction"},
	{0x7121, "motor blocked"},
	{0x7120, "motor"},
	{0x7110, "brake chopper"},
	{0x7100, "power additional modules"},
	{0x7000, "additional modules"},
	{0x6330, "error in the parameters"},
	{0x6320, "parameter error"},
	{0x6310, "loss of parameters"},
	{0x6300, "data record"},
	{0x6200, "user software"},
	{0x6100, "internal software"},
	{0x6010, "software reset (watchdog)"},
	{0x6000, "software of the device"},
	{0x5540, "EEPROM"},
	{0x5530, "non-volatile data memory"},
	{0x5520, "ROM or EPROM"},
	{0x5510, "RAM"},
	{0x5500, "data storage"},
	{0x5442, "contacts 2"},
	{0x5441, "contacts 1"},
	{0x5440, "contacts"},
	{0x5430, "input stages"},
	{0x5420, "chopper"},
	{0x5410, "output stages"},
	{0x5400, "power section"},
	{0x5300, "operating unit"},
	{0x5220, "computing circuit"},
	{0x5210, "measurement circuit"},
	{0x5200, "control hardware"},
	{0x5114, "supply low voltage: 5 V of the electronics"},
	{0x5113, "supply low voltage: 5 V"},
	{0x5112, "supply low voltage: 24 V"},
	{0x5111, "supply low voltage: ±15 V"},
	{0x5110, "low supply voltage"},
	{0x5100, "supply"},
	{0x5000, "hardware of the device"},
	{0x4430, "excess temperature: power stage"},
	{0x4420, "temperature of the supply too low"},
	{0x4410, "temperature of the supply too high"},
	{0x4400, "temperature of the supply"},
	{0x4320, "temperature of the drive too low"},
	{0x4310, "temperature of the drive too high"},
	{0x4300, "temperature of the drive"},
	{0x4220, "temperature of the device too low"},
	{0x4210, "temperature of the device too high"},
	{0x4200, "temperature of the device"},
	{0x4120, "ambient temperature too low"},
	{0x4110, "ambient temperature too high"},
	{0x4100, "ambient temperature"},
	{0x4000, "temperature"},
	{0x3331, "field circuit interrupted"},
	{0x3330, "field circuit"},
	{0x3320, "armature circuit"},
	{0x3310, "output voltage too high"},
	{0x3300, "output voltage"},
	{0x3230, "load error"},
	{0x3222, "DC link under-voltage 2"},
	{0x3221, "DC link under-voltage 1"},
	{0x3220, "DC link under-voltage"},
	{0x3212, "DC link over-voltage 2"},
	{0x3211, "DC link over-voltage 1"},
	{0x3210, "DC link over-voltage"},
	{0x3200, "voltage inside the device"},
	{0x3130, "phase failure"},
	{0x3120, "mains under-voltage"},
	{0x3110, "mains over-voltage"},
	{0x3100, "mains voltage"},
	{0x3000, "voltage"},
	{0x2396, "current of the holding brake"},
	{0x2350, "motor overloaded (I²t)"},
	{0x2340, "short circuit, motor side"},
	{0x2330, "earth leakage, motor side"},
	{0x2320, "short circuit or earth leakage, motor side"},
	{0x2310, "continuous over-current, motor side"},
	{0x2300, "current, motor side"},
	{0x2220, "continuous over-current inside the device"},
	{0x2213, "over-current in the ramp"},
	{0x2212, "over-current 2 inside the device"},
	{0x2211, "over-current 1 inside the device"},
	{0x2200, "current inside the device"},
	{0x2130, "short circuit"},
	{0x2120, "short to earth"},
	{0x2110, "short circuit or earth leakage, input side"},
	{0x2100, "current, input side"},
	{0x2000, "current"},
	{0x1000, "generic error"},
	{0x0000, "no error, or reset"},
};

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

const char *canopen_abort_text(uint32_t code, char *text, size_t size)
{
	const char *name = "an abort code not in CiA 301";

	for (size_t i = 0; i < COUNT(aborts); i++)
		if (aborts[i].code == code)
			name = aborts[i].text;
	snprintf(text, size, "%s (%08Xh)", name, code);
	return text;
}

/* Returns the text of the code, else of its class: xx00, then x000. */
static const char *emcy_name(uint16_t code)
{
	static const uint16_t masks[] = {0xffff, 0xfff0, 0xff00, 0xf000};

	for (size_t m = 0; m < COUNT(masks); m++)
		for (size_t i = 0; i < COUNT(emcys); i++)
			if (emcys[i].code == (code & masks[m]) &&
			    (emcys[i].code || !code))
				return emcys[i].text;
	return NULL;
}

const char *canopen_emcy_text(uint16_t code, char *text, size_t size)
{
	const char *name = emcy_name(code);

	snprintf(text, size, "%s (%04Xh)", name ? name : "an error without a class",
		 code);
	return text;
}

const char *canopen_state_name(enum canopen_state state)
{
	switch (state) {
	case CANOPEN_BOOT_UP:
		return "booting";
	case CANOPEN_STOPPED:
		return "stopped";
	case CANOPEN_OPERATIONAL:
		return "operational";
	case CANOPEN_PRE_OPERATIONAL:
		return "pre-operational";
	case CANOPEN_UNKNOWN:
		break;
	}
	return "not heard";
}
