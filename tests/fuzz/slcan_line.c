// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of a serial line under libFuzzer: each frame is valid and survives formatting and parsing,
 * and after a CR the next line is parsed.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can/netlink.h>
#include "../../lib/device/can/bus/slcan_protocol.h"

static void wrong(const char *what)
{
	fprintf(stderr, "slcan_line: %s\n", what);
	abort();
}

static enum slcan_kind receive_all(const char *text, size_t n,
				   struct slcan_message *message)
{
	struct slcan_line line = {0};
	enum slcan_kind kind = SLCAN_NONE;

	for (size_t i = 0; i < n; i++) {
		if (kind != SLCAN_NONE)
			wrong("a line ends before its end");
		kind = slcan_line_receive(&line, (unsigned char)text[i], message);
	}
	return kind;
}

static void check_frame(const struct can_frame *frame)
{
	bool extended = frame->can_id & CAN_EFF_FLAG;
	struct slcan_message message;
	/* Its size is that of the longest line: the sanitizer watches its end. */
	char text[SLCAN_LINE_MAX];
	size_t n;

	if (frame->can_id & CAN_ERR_FLAG || frame->can_dlc > 8)
		wrong("no frame of a bus");
	if (!extended && frame->can_id & CAN_EFF_MASK & ~CAN_SFF_MASK)
		wrong("a large id in a short frame");
	n = slcan_line_format(text, frame);
	if (!n || n > sizeof(text))
		wrong("it cannot be said");
	memset(&message, 0xff, sizeof(message));
	if (receive_all(text, n, &message) != SLCAN_FRAME ||
	    memcmp(&message.frame, frame, sizeof(*frame)))
		wrong("it is read in another way than it is said");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct slcan_line line = {0};
	struct slcan_message message;

	for (size_t i = 0; i < size; i++) {
		enum slcan_kind kind;

		memset(&message, 0xff, sizeof(message));
		kind = slcan_line_receive(&line, data[i], &message);
		if (kind != SLCAN_NONE && data[i] != '\r' && data[i] != '\a')
			wrong("a line ends without an end");
		if (kind == SLCAN_FRAME)
			check_frame(&message.frame);
		if (kind == SLCAN_STATE && (message.state < CAN_STATE_ERROR_ACTIVE ||
					    message.state > CAN_STATE_BUS_OFF))
			wrong("a state that there is not");
		if (line.n > sizeof(line.text))
			wrong("a line longer than its place");
	}
	slcan_line_receive(&line, '\r', &message);
	for (const char *c = "t1232aAbB"; *c; c++)
		if (slcan_line_receive(&line, (unsigned char)*c, &message) != SLCAN_NONE)
			wrong("a line ends too early");
	if (slcan_line_receive(&line, '\r', &message) != SLCAN_FRAME ||
	    message.frame.can_id != 0x123 || message.frame.can_dlc != 2 ||
	    message.frame.data[1] != 0xbb)
		wrong("it does not find the next line");
	return 0;
}
