/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The slcan protocol of Lawicel's CAN232 and CANUSB manuals, without device or clock: bytes to
 * frames and back, and the controller's status as error frames of linux/can/error.h.
 *
 *   t123 2 AABB [01F4] ╮  data, 11 bit       r1232   remote    z, Z, ""  done
 *   T12345678 2 AABB   ├╴ data, 29 bit       R…      remote    BEL       refused
 *     id      │ data   ╯  timestamp if on:   F80     status    saXXXYYY  state (newer ones)
 *             ╰ bytes, 0 … 8   4 digits, of some adapters 8
 *
 * A line ends with CR, or is a BEL. Anything else is reported once and skipped to its end.
 */
#ifndef INCISE_SLCAN_PROTOCOL_H
#define INCISE_SLCAN_PROTOCOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <linux/can.h>

/* The longest line without its CR: "T", 8 digits, length, 16 digits, timestamp. */
#define SLCAN_LINE_MAX 34

enum slcan_kind {
	SLCAN_NONE,    /* an unfinished line, or an acknowledgement */
	SLCAN_FRAME,   /* a frame of the bus */
	SLCAN_REFUSED, /* BEL */
	SLCAN_FLAGS,   /* answer to F: SLCAN_… bits below */
	SLCAN_STATE,   /* enum can_state; newer adapters send it unasked */
	SLCAN_OTHER,   /* a command of another host, or the answer to one */
	SLCAN_BROKEN,  /* no line: too long, impossible bytes, numbers out of range */
};

/* The status flags of an SJA1000, which reading them clears. */
#define SLCAN_RX_FULL 0x01
#define SLCAN_TX_FULL 0x02
#define SLCAN_WARNING 0x04
#define SLCAN_OVERRUN 0x08
#define SLCAN_PASSIVE 0x20
#define SLCAN_LOST_ARBITRATION 0x40 /* usual on a busy bus: no error */
#define SLCAN_BUS_ERROR 0x80

struct slcan_line {
	char text[SLCAN_LINE_MAX];
	uint8_t n;
	bool broken; /* skip to its end */
};

/* The content of a line; which field is valid depends on the kind. */
struct slcan_message {
	struct can_frame frame;
	uint8_t flags;
	int state;
};

/* Add a byte to a line, which starts as {0}; the returned kind defines *message. */
enum slcan_kind slcan_line_receive(struct slcan_line *line, unsigned char byte,
				   struct slcan_message *message);

/*
 * Write a frame as a line with its CR, without a 0, of at most SLCAN_LINE_MAX bytes. Returns
 * the number of bytes; 0: slcan cannot express it (an error frame, more than 8 bytes).
 */
size_t slcan_line_format(char *text, const struct can_frame *frame);

/*
 * The state of an adapter's controller. The host sends a query (F) along with a frame each
 * 100 ms, but soon stops if the adapter does not implement it.
 *
 *   F ─▶ adapter ─▶ F80, saXXXYYY or BEL ─▶ changed flags or state: an error frame
 */
struct slcan_status {
	int state; /* enum can_state; -EOPNOTSUPP: never reported */

	/* private */
	uint8_t flags;
	int64_t query_ns;
	unsigned int refused_queries;
	bool pending, answers; /* a query is open; a query was answered before */
	unsigned int refusals; /* of start commands that are still to be expected */
};

/* @refusals: the adapter may refuse as many start commands, for example C when it is closed. */
void slcan_status_init(struct slcan_status *status, unsigned int refusals,
		       int64_t now_ns);

/* Returns whether a query is due; note that it was sent. */
bool slcan_status_due(const struct slcan_status *status, int64_t now_ns);
void slcan_status_queried(struct slcan_status *status, int64_t now_ns);

/*
 * Update by SLCAN_REFUSED, SLCAN_FLAGS or SLCAN_STATE. Returns true if *frame is an error
 * frame that reports a change.
 */
bool slcan_status_update(struct slcan_status *status, enum slcan_kind kind,
			 const struct slcan_message *message, struct can_frame *frame);

#endif
