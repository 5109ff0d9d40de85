/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A small CANopen master (CiA 301) for one node: SDO, NMT, heartbeats both ways, EMCY. It has
 * no object dictionary of its own. One thread at a time.
 *
 *   node: 0x000 NMT   0x080 SYNC   0x080+n EMCY   0x580+n, 0x600+n SDO   0x700+n heartbeat
 *
 * Functions that wait do so on the bus's clock for at most a given time; meanwhile they handle
 * other frames and send this side's heartbeat when it is due. No input is trusted: lengths,
 * toggle bits and sizes are checked.
 */
#ifndef INCISE_CANOPEN_H
#define INCISE_CANOPEN_H

#include <stdbool.h>
#include <stddef.h>
#include "../bus/can_bus.h"

#define CANOPEN_NMT 0x000
#define CANOPEN_SYNC 0x080
#define CANOPEN_EMCY 0x080
#define CANOPEN_TPDO1 0x180
#define CANOPEN_RPDO1 0x200
#define CANOPEN_TPDO2 0x280
#define CANOPEN_SDO_ANSWER 0x580
#define CANOPEN_SDO_REQUEST 0x600
#define CANOPEN_HEARTBEAT 0x700

/* NMT commands. */
enum canopen_command {
	CANOPEN_START = 0x01,
	CANOPEN_STOP = 0x02,
	CANOPEN_PREPARE = 0x80, /* enter pre-operational */
	CANOPEN_RESET_NODE = 0x81,
	CANOPEN_RESET_COMMUNICATION = 0x82,
};

/* NMT states, as a heartbeat gives them. */
enum canopen_state {
	CANOPEN_BOOT_UP = 0x00,
	CANOPEN_STOPPED = 0x04,
	CANOPEN_OPERATIONAL = 0x05,
	CANOPEN_PRE_OPERATIONAL = 0x7f,
	CANOPEN_UNKNOWN = 0xff, /* not received */
};

/* The last emergency message about an error; those about the end of one are not kept. */
struct canopen_emcy {
	uint16_t code;		/* 0: none */
	uint8_t error_register; /* object 1001 */
	uint32_t count;		/* since the bus was opened */
};

struct canopen {
	struct can_bus *bus;
	uint8_t node;	      /* 1 … 127 */
	uint8_t own;	      /* node id of this side's heartbeat; 0: not sent */
	int64_t heartbeat_ns; /* its period */
	int64_t answer_ns;    /* timeout of an SDO; 0: CANOPEN_ANSWER_NS */

	/* Received from the node. */
	enum canopen_state state;
	int64_t last_heartbeat_ns; /* or boot-up; 0: not received */
	uint32_t boots;		   /* boot-up messages */
	struct canopen_emcy emcy;
	uint32_t bus_offs; /* how often it was bus-off */
	/* SYNCs, NMT commands, heartbeats of @own and PDOs to this node by another master. */
	uint32_t foreign;

	uint32_t abort; /* code of the last aborted SDO */
	int64_t late_ns; /* after which the answer came that the last SDO did not wait for; 0 */
	/* Requests sent, and how many of them came back as they were: an adapter's echo. */
	uint32_t requests, echoes;

	/* private */
	uint8_t request[8]; /* the last one */
	int64_t next_heartbeat_ns;
	/* The answer that an SDO waits for: about this object, or the next segment. */
	struct canopen_answer {
		bool wanted, segment, received;
		uint8_t object[3]; /* index and sub, as a frame has them */
		uint8_t data[8];
	} answer;
};

/* Little-endian numbers of @n bytes, at most 4, as frames have them. */
void canopen_pack(uint8_t *bytes, int n, uint32_t value);
uint32_t canopen_unpack(const uint8_t *bytes, int n);

#define CANOPEN_ANSWER_NS 200000000 /* ample also for a busy drive */
#define CANOPEN_LATE_NS 400000000   /* more, in which a late answer is only noted */

/*
 * Handle a received frame: heartbeats, boot-ups, EMCYs and error frames update @master. For
 * other frames of this node returns the function, that is can_id less the node, for example
 * CANOPEN_TPDO1 or CANOPEN_SDO_ANSWER; else 0.
 */
uint32_t canopen_handle(struct canopen *master, const struct can_frame *frame,
			int64_t t_ns);

/*
 * Send this side's heartbeat if it is due. Returns 0 or an error of the bus; after -ENOBUFS it
 * is due again a millisecond later.
 */
int canopen_send_heartbeat(struct canopen *master, int64_t now_ns);

bool canopen_is_operational(const struct canopen *master);

/* Send a command to the node alone. Returns 0 or an error of the bus. */
int canopen_send_nmt(struct canopen *master, enum canopen_command command);

/*
 * Handle frames until @done returns true, or @until_ns; NULL: until @until_ns. Returns 0,
 * -ETIMEDOUT, -EINTR or an error of the bus.
 */
int canopen_await(struct canopen *master, bool (*done)(const struct canopen *master),
		  int64_t until_ns);

/*
 * Read or write an object by SDO. Both return 0; -EREMOTEIO (aborted: master->abort),
 * -ETIMEDOUT (no answer, or late_ns; the node receives an abort), -EPROTO (an invalid answer, or one of
 * another size), -EINTR, or an error of the bus. Answers about other objects, which another
 * master requested, are skipped.
 *
 * @size 1, 2 or 4 bytes; *value is not sign-extended: -1 of 16 bits is 0xffff
 */
int canopen_read(struct canopen *master, uint16_t index, uint8_t sub, int size,
		 uint32_t *value);
int canopen_write(struct canopen *master, uint16_t index, uint8_t sub, int size,
		  uint32_t value);

/* Read a string, for example 1008, device name: printable, cut to @size, ends with 0. */
int canopen_read_text(struct canopen *master, uint16_t index, uint8_t sub, char *text,
		      size_t size);

/* Write "object does not exist (06020000h)", for any code, to @text, and return that. */
const char *canopen_abort_text(uint32_t code, char *text, size_t size);

/* Likewise "following error too large (8611h)"; for an unknown code the text of its class. */
const char *canopen_emcy_text(uint16_t code, char *text, size_t size);

/* "pre-operational" … */
const char *canopen_state_name(enum canopen_state state);

#endif
