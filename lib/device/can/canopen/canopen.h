/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A small CANopen master (CiA 301) for one node: SDO, NMT, heartbeats both ways, EMCY. One
 * thread at a time. Only what a drive needs; no dictionary of our own.
 *
 *   node: 0x000 NMT   0x080 SYNC   0x080+n EMCY   0x580+n, 0x600+n SDO   0x700+n heartbeat
 *
 * What waits, waits on the bus's clock for at most a given time, and meanwhile takes what
 * else comes and sends this side's heartbeat when it is due. Nothing that comes in is
 * trusted: lengths, toggle bits and sizes are checked.
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
	CANOPEN_UNKNOWN = 0xff, /* none was heard */
};

/* The last that tells of an error; those that tell that it is over are not kept. */
struct canopen_emcy {
	uint16_t code;		/* 0: there was none */
	uint8_t error_register; /* object 1001 */
	uint8_t vendor[5];
	uint32_t count; /* since it was opened */
};

struct canopen {
	struct can_bus *bus;
	uint8_t node;	   /* 1 … 127 */
	uint8_t own;	   /* node id of this side's heartbeat; 0: none is sent */
	int64_t beat_ns;   /* between two of them */
	int64_t answer_ns; /* an SDO is answered within this; 0: CANOPEN_ANSWER_NS */

	/* What was heard of the node. */
	enum canopen_state state;
	int64_t heard_ns; /* its last heartbeat or boot-up; 0: none */
	uint32_t boots;	  /* boot-up messages */
	struct canopen_emcy emcy;
	/* The last error frame on the bus: CAN_ERR_… of can_id and its data; 0: none. */
	uint32_t bus_error;
	uint8_t bus_error_data[8];
	uint32_t bus_offs; /* times that it was bus-off */
	/* SYNCs, NMT commands, heartbeats of our id, and PDOs to this node: not from us. */
	uint32_t foreign;

	uint32_t abort; /* code of the last SDO that was aborted */

	/* private */
	int64_t next_beat_ns;
	/* The answer that an SDO waits for: of this object, or the next segment. */
	struct canopen_answer {
		bool wanted, segment, came;
		uint8_t object[3]; /* index and sub, as a frame has them */
		uint8_t data[8];
	} answer;
};

#define CANOPEN_ANSWER_NS 200000000 /* for an SDO: ample, for a drive that is busy */

/*
 * Take a frame: heartbeat, boot-up, EMCY and error frames are noted. Returns its function:
 * can_id less the node, such as CANOPEN_TPDO1 or CANOPEN_SDO_ANSWER, for frames of this node;
 * 0 where it is none of them or was noted.
 */
uint32_t canopen_take(struct canopen *master, const struct can_frame *frame,
		      int64_t t_ns);

/*
 * Send this side's heartbeat if it is due. 0 or what the bus says; with -ENOBUFS it is tried
 * again a millisecond later.
 */
int canopen_beat(struct canopen *master, int64_t now_ns);

/* To the node alone. 0 or what the bus says. */
int canopen_nmt(struct canopen *master, enum canopen_command command);

/*
 * Until @done of what was heard is so, or the time has come; NULL: until the time has come.
 * 0, -ETIMEDOUT, -EINTR where the bus's wait says so, of the bus.
 */
int canopen_await(struct canopen *master, bool (*done)(const struct canopen *master),
		  int64_t until_ns);

/*
 * Read or write an object by SDO. Both: 0; -EREMOTEIO (aborted: master->abort), -ETIMEDOUT
 * (no answer; the node is told so), -EPROTO (an answer that makes no sense, or of another
 * size), -EINTR, and what the bus says. Answers for other objects are somebody else's and
 * are passed over.
 *
 * @size 1, 2 or 4 bytes; *value is not extended: 0xffff is -1 of 16 bits
 */
int canopen_read(struct canopen *master, uint16_t index, uint8_t sub, int size,
		 uint32_t *value);
int canopen_write(struct canopen *master, uint16_t index, uint8_t sub, int size,
		  uint32_t value);

/* A string such as 1008, device name: always ends with 0, printable, cut to @size. */
int canopen_read_text(struct canopen *master, uint16_t index, uint8_t sub, char *text,
		      size_t size);

/* "object does not exist (06020000h)"; of any code. The text is in @text. */
const char *canopen_abort_text(uint32_t code, char *text, size_t size);

/* "following error too large (8611h)"; of any code, by its class where it is not known. */
const char *canopen_emcy_text(uint16_t code, char *text, size_t size);

/* "pre-operational" … */
const char *canopen_state_name(enum canopen_state state);

#endif
