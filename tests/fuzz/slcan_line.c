// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of a serial line under libFuzzer: whatever comes, a frame is one that the bus can
 * have, is said and read back the same, and after a CR the next line is read.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can/netlink.h>
#include "../../lib/device/can/bus/slcan_line.h"

static void wrong(const char *what)
{
	fprintf(stderr, "slcan_line: %s\n", what);
	abort();
}

static enum slcan_kind take_all(const char *text, size_t n, struct slcan_told *told)
{
	struct slcan_line line = {0};
	enum slcan_kind kind = SLCAN_NONE;

	for (size_t i = 0; i < n; i++) {
		if (kind != SLCAN_NONE)
			wrong("a line ends before its end");
		kind = slcan_line_take(&line, (unsigned char)text[i], told);
	}
	return kind;
}

static void check_frame(const struct can_frame *frame)
{
	bool extended = frame->can_id & CAN_EFF_FLAG;
	struct slcan_told told;
	/* Its size is that of the longest line: the sanitizer watches its end. */
	char text[SLCAN_LINE_MAX];
	size_t n;

	if (frame->can_id & CAN_ERR_FLAG || frame->can_dlc > 8)
		wrong("no frame of a bus");
	if (!extended && frame->can_id & CAN_EFF_MASK & ~CAN_SFF_MASK)
		wrong("a large id in a short frame");
	n = slcan_line_put(text, frame);
	if (!n || n > sizeof(text))
		wrong("it cannot be said");
	memset(&told, 0xff, sizeof(told));
	if (take_all(text, n, &told) != SLCAN_FRAME ||
	    memcmp(&told.frame, frame, sizeof(*frame)))
		wrong("it is read in another way than it is said");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct slcan_line line = {0};
	struct slcan_told told;

	for (size_t i = 0; i < size; i++) {
		enum slcan_kind kind;

		memset(&told, 0xff, sizeof(told));
		kind = slcan_line_take(&line, data[i], &told);
		if (kind != SLCAN_NONE && data[i] != '\r' && data[i] != '\a')
			wrong("a line ends without an end");
		if (kind == SLCAN_FRAME)
			check_frame(&told.frame);
		if (kind == SLCAN_STATE && (told.state < CAN_STATE_ERROR_ACTIVE ||
					    told.state > CAN_STATE_BUS_OFF))
			wrong("a state that there is not");
		if (line.n > sizeof(line.text))
			wrong("a line longer than its place");
	}
	slcan_line_take(&line, '\r', &told);
	for (const char *c = "t1232aAbB"; *c; c++)
		if (slcan_line_take(&line, (unsigned char)*c, &told) != SLCAN_NONE)
			wrong("a line ends too early");
	if (slcan_line_take(&line, '\r', &told) != SLCAN_FRAME ||
	    told.frame.can_id != 0x123 || told.frame.can_dlc != 2 ||
	    told.frame.data[1] != 0xbb)
		wrong("it does not find the next line");
	return 0;
}
