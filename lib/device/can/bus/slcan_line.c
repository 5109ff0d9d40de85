// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The lines of slcan; see slcan_line.h. Anything may come in: another program's output, the
 * middle of a line, a modem.
 */
#include <string.h>
#include <linux/can/netlink.h>
#include "../../../base/hex.h"
#include "slcan_line.h"

#define CR '\r'
#define BEL '\a'

/* @n hex digits, at most 8. */
static bool number(const char *text, unsigned int n, uint32_t *value)
{
	*value = 0;
	for (unsigned int i = 0; i < n; i++) {
		int d = incise_hex_digit(text[i]);

		if (d < 0)
			return false;
		*value = *value << 4 | (uint32_t)d;
	}
	return true;
}

static enum slcan_kind frame_of(const char *text, unsigned int n, struct can_frame *frame)
{
	bool extended = *text == 'T' || *text == 'R';
	bool remote = *text == 'r' || *text == 'R';
	unsigned int digits = extended ? 8 : 3, at = 1 + digits + 1, end;
	uint32_t id, value;

	memset(frame, 0, sizeof(*frame));
	if (n < at || !number(text + 1, digits, &id) ||
	    id > (extended ? CAN_EFF_MASK : CAN_SFF_MASK))
		return SLCAN_BROKEN;
	if (text[at - 1] < '0' || text[at - 1] > '8')
		return SLCAN_BROKEN;
	frame->can_id = id | (extended ? CAN_EFF_FLAG : 0) | (remote ? CAN_RTR_FLAG : 0);
	frame->can_dlc = (uint8_t)(text[at - 1] - '0');
	end = at + (remote ? 0 : 2u * frame->can_dlc);
	/* With a stamp of four digits or without one; all else has lost bytes, or won some. */
	if (n != end && (n != end + 4 || !number(text + end, 4, &value)))
		return SLCAN_BROKEN;
	for (unsigned int i = 0; at < end; i++, at += 2) {
		if (!number(text + at, 2, &value))
			return SLCAN_BROKEN;
		frame->data[i] = (uint8_t)value;
	}
	return SLCAN_FRAME;
}

/* sa, sw, sp or sb, and both error counters, three decimal digits each. */
static bool state_of(const char *text, unsigned int n, int *state)
{
	static const char letters[] = "awpb";
	const char *letter = n == 8 ? memchr(letters, text[1], 4) : NULL;

	if (!letter)
		return false;
	for (unsigned int i = 2; i < n; i++)
		if (text[i] < '0' || text[i] > '9')
			return false;
	*state = CAN_STATE_ERROR_ACTIVE + (int)(letter - letters);
	return true;
}

static bool is_word(const char *text, unsigned int n)
{
	for (unsigned int i = 0; i < n; i++)
		if ((text[i] < '0' || text[i] > '9') &&
		    ((text[i] | 0x20) < 'a' || (text[i] | 0x20) > 'z'))
			return false;
	return true;
}

static enum slcan_kind line_of(const char *text, unsigned int n, struct slcan_told *told)
{
	uint32_t value;

	if (!n)
		return SLCAN_NONE;
	switch (*text) {
	case 't':
	case 'T':
	case 'r':
	case 'R':
		return frame_of(text, n, &told->frame);
	case 'z':
	case 'Z':
		if (n == 1)
			return SLCAN_NONE;
		break;
	case 'F':
		if (n == 3 && number(text + 1, 2, &value)) {
			told->flags = (uint8_t)value;
			return SLCAN_FLAGS;
		}
		break;
	case 's':
		if (state_of(text, n, &told->state))
			return SLCAN_STATE;
		break;
	}
	return is_word(text, n) ? SLCAN_OTHER : SLCAN_BROKEN;
}

enum slcan_kind slcan_line_take(struct slcan_line *line, unsigned char byte,
				struct slcan_told *told)
{
	enum slcan_kind kind;

	if (byte == CR || byte == BEL) {
		/* A BEL within a line has cut it off. */
		if (line->broken || (byte == BEL && line->n))
			kind = SLCAN_BROKEN;
		else
			kind = byte == BEL ? SLCAN_REFUSED
					   : line_of(line->text, line->n, told);
		line->n = 0;
		line->broken = false;
		return kind;
	}
	/* Some end their lines with CR LF. */
	if (byte == '\n' && !line->n && !line->broken)
		return SLCAN_NONE;
	if (line->n == sizeof(line->text))
		line->broken = true;
	else
		line->text[line->n++] = (char)byte;
	return SLCAN_NONE;
}

static char *put(char *text, uint32_t value, unsigned int digits)
{
	while (digits--)
		*text++ = "0123456789ABCDEF"[value >> (4 * digits) & 0xf];
	return text;
}

size_t slcan_line_put(char *text, const struct can_frame *frame)
{
	bool extended = frame->can_id & CAN_EFF_FLAG,
	     remote = frame->can_id & CAN_RTR_FLAG;
	char *at = text;

	if (frame->can_id & CAN_ERR_FLAG || frame->can_dlc > CAN_MAX_DLEN)
		return 0;
	*at++ = extended ? (remote ? 'R' : 'T') : (remote ? 'r' : 't');
	at = extended ? put(at, frame->can_id & CAN_EFF_MASK, 8)
		      : put(at, frame->can_id & CAN_SFF_MASK, 3);
	*at++ = (char)('0' + frame->can_dlc);
	for (unsigned int i = 0; !remote && i < frame->can_dlc; i++)
		at = put(at, frame->data[i], 2);
	*at++ = CR;
	return (size_t)(at - text);
}
