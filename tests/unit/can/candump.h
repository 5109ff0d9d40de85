/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Frames as candump -L writes them, so that what was recorded on a bus can be played here:
 *
 *   590#4300100092010200   an id of 11 bits, data      123#R8     remote, of 8 bytes
 *   12ABCDEF#AA55          8 digits: one of 29 bits    20000040#01   an error frame
 */
#ifndef INCISE_TEST_CANDUMP_H
#define INCISE_TEST_CANDUMP_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can.h>

/* The frame at the start of @text; a space may end it. */
static inline struct can_frame candump_read(const char *text)
{
	struct can_frame frame = {.can_id = (canid_t)strtoul(text, NULL, 16)};
	const char *data = strchr(text, '#') + 1;

	if (data - text == 9 && !(frame.can_id & CAN_ERR_FLAG))
		frame.can_id |= CAN_EFF_FLAG;
	if (*data == 'R') {
		frame.can_id |= CAN_RTR_FLAG;
		frame.len = data[1] ? (uint8_t)(data[1] - '0') : 0;
		return frame;
	}
	for (; *data && *data != ' '; data += 2) {
		unsigned int byte = 0;

		sscanf(data, "%2x", &byte);
		frame.data[frame.len++] = (uint8_t)byte;
	}
	return frame;
}

#endif
