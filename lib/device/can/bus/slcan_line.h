/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The lines of slcan, as Lawicel's CAN232 and CANUSB manuals say them: bytes to frames and
 * back. It knows no device and no clock.
 *
 *   t123 2 AABB [01F4] ╮  data, 11 bit       r1232   remote    z, Z, ""  done
 *   T12345678 2 AABB   ├╴ data, 29 bit       R…      remote    BEL       refused
 *     id      │ data   ╯  stamp, ms, if on   F80     status    saXXXYYY  state (newer ones)
 *             ╰ bytes, 0 … 8
 *
 * A line ends with CR, or is a BEL. What is no line is told once and skipped to its end.
 */
#ifndef INCISE_SLCAN_LINE_H
#define INCISE_SLCAN_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <linux/can.h>

/* "T", 8 digits, length, 16 digits, stamp: the longest, without its CR. */
#define SLCAN_LINE_MAX 30

enum slcan_kind {
	SLCAN_NONE,    /* the line goes on, or was an answer that all is well */
	SLCAN_FRAME,   /* a frame of the bus */
	SLCAN_REFUSED, /* BEL */
	SLCAN_FLAGS,   /* answer to F: SLCAN_… bits below */
	SLCAN_STATE,   /* enum can_state; newer adapters tell it unasked */
	SLCAN_OTHER,   /* a command of another host, an answer to one: not for us */
	SLCAN_BROKEN,  /* no line: too long, bytes that none has, numbers too large */
};

/* The status flags; of an SJA1000, which forgets them when they are read. */
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

/* What a line said, by its kind. */
struct slcan_told {
	struct can_frame frame;
	uint8_t flags;
	int state;
};

/* Take a byte. *told is written where the kind says so. A line starts as {0}. */
enum slcan_kind slcan_line_take(struct slcan_line *line, unsigned char byte,
				struct slcan_told *told);

/*
 * A frame as a line with its CR, without a 0, of at most SLCAN_LINE_MAX bytes. Returns how
 * many; 0: it cannot be said (an error frame, more than 8 bytes).
 */
size_t slcan_line_put(char *text, const struct can_frame *frame);

#endif
