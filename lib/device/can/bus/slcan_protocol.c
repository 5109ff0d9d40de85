// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The slcan protocol; see slcan_protocol.h. Any bytes may come in: another program's output,
 * the middle of a line, a modem.
 */
#include <errno.h>
#include <string.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../base/hex.h"
#include "slcan_protocol.h"

#define CR '\r'
#define BEL '\a'
#define QUERY_NS 100000000
#define REFUSED_QUERIES_MAX 3 /* then no more are sent */

/* Parse @n hex digits, at most 8. */
static bool parse_hex(const char *text, unsigned int n, uint32_t *value)
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

static enum slcan_kind parse_frame(const char *text, unsigned int n,
				   struct can_frame *frame)
{
	bool extended = *text == 'T' || *text == 'R';
	bool remote = *text == 'r' || *text == 'R';
	unsigned int digits = extended ? 8 : 3, at = 1 + digits + 1, end;
	uint32_t id, value;

	memset(frame, 0, sizeof(*frame));
	if (n < at || !parse_hex(text + 1, digits, &id) ||
	    id > (extended ? CAN_EFF_MASK : CAN_SFF_MASK))
		return SLCAN_BROKEN;
	if (text[at - 1] < '0' || text[at - 1] > '8')
		return SLCAN_BROKEN;
	frame->can_id = id | (extended ? CAN_EFF_FLAG : 0) | (remote ? CAN_RTR_FLAG : 0);
	frame->can_dlc = (uint8_t)(text[at - 1] - '0');
	end = at + (remote ? 0 : 2u * frame->can_dlc);
	/* With a timestamp of 4 or 8 digits or without; other lengths come of lost bytes. */
	if (n != end &&
	    ((n != end + 4 && n != end + 8) || !parse_hex(text + end, n - end, &value)))
		return SLCAN_BROKEN;
	for (unsigned int i = 0; at < end; i++, at += 2) {
		if (!parse_hex(text + at, 2, &value))
			return SLCAN_BROKEN;
		frame->data[i] = (uint8_t)value;
	}
	return SLCAN_FRAME;
}

/* Parse sa, sw, sp or sb with both error counters, three decimal digits each. */
static bool parse_state(const char *text, unsigned int n, int *state)
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

static bool is_alphanumeric(const char *text, unsigned int n)
{
	for (unsigned int i = 0; i < n; i++)
		if ((text[i] < '0' || text[i] > '9') &&
		    ((text[i] | 0x20) < 'a' || (text[i] | 0x20) > 'z'))
			return false;
	return true;
}

static enum slcan_kind parse_line(const char *text, unsigned int n,
				  struct slcan_message *message)
{
	uint32_t value;

	if (!n)
		return SLCAN_NONE;
	switch (*text) {
	case 't':
	case 'T':
	case 'r':
	case 'R':
		return parse_frame(text, n, &message->frame);
	case 'z':
	case 'Z':
		if (n == 1)
			return SLCAN_NONE;
		break;
	case 'F':
		if (n == 3 && parse_hex(text + 1, 2, &value)) {
			message->flags = (uint8_t)value;
			return SLCAN_FLAGS;
		}
		break;
	case 's':
		if (parse_state(text, n, &message->state))
			return SLCAN_STATE;
		break;
	}
	return is_alphanumeric(text, n) ? SLCAN_OTHER : SLCAN_BROKEN;
}

enum slcan_kind slcan_line_receive(struct slcan_line *line, unsigned char byte,
				   struct slcan_message *message)
{
	enum slcan_kind kind;

	if (byte == CR || byte == BEL) {
		/* A BEL within a line cuts it off. */
		if (line->broken || (byte == BEL && line->n))
			kind = SLCAN_BROKEN;
		else
			kind = byte == BEL ? SLCAN_REFUSED
					   : parse_line(line->text, line->n, message);
		line->n = 0;
		line->broken = false;
		return kind;
	}
	/* Some adapters end lines with CR LF. */
	if (byte == '\n' && !line->n && !line->broken)
		return SLCAN_NONE;
	if (line->n == sizeof(line->text))
		line->broken = true;
	else
		line->text[line->n++] = (char)byte;
	return SLCAN_NONE;
}

static char *format_hex(char *text, uint32_t value, unsigned int digits)
{
	while (digits--)
		*text++ = "0123456789ABCDEF"[value >> (4 * digits) & 0xf];
	return text;
}

size_t slcan_line_format(char *text, const struct can_frame *frame)
{
	bool extended = frame->can_id & CAN_EFF_FLAG,
	     remote = frame->can_id & CAN_RTR_FLAG;
	char *at = text;

	if (frame->can_id & CAN_ERR_FLAG || frame->can_dlc > CAN_MAX_DLEN)
		return 0;
	*at++ = extended ? (remote ? 'R' : 'T') : (remote ? 'r' : 't');
	at = extended ? format_hex(at, frame->can_id & CAN_EFF_MASK, 8)
		      : format_hex(at, frame->can_id & CAN_SFF_MASK, 3);
	*at++ = (char)('0' + frame->can_dlc);
	for (unsigned int i = 0; !remote && i < frame->can_dlc; i++)
		at = format_hex(at, frame->data[i], 2);
	*at++ = CR;
	return (size_t)(at - text);
}

void slcan_status_init(struct slcan_status *s, unsigned int refusals, int64_t now_ns)
{
	*s = (struct slcan_status){
		.state = -EOPNOTSUPP, .query_ns = now_ns, .refusals = refusals};
}

bool slcan_status_due(const struct slcan_status *s, int64_t now_ns)
{
	return s->refused_queries < REFUSED_QUERIES_MAX &&
	       now_ns - s->query_ns >= QUERY_NS;
}

void slcan_status_queried(struct slcan_status *s, int64_t now_ns)
{
	s->query_ns = now_ns;
	s->pending = true;
}

static void make_error_frame(struct can_frame *frame, canid_t classes, uint8_t controller)
{
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CAN_ERR_FLAG | classes;
	frame->can_dlc = CAN_ERR_DLC;
	frame->data[1] = controller;
}

/* Returns whether the state changed; adds the bits that an error frame has for it. */
static bool change_state(struct slcan_status *s, int state, uint8_t *controller)
{
	int before = s->state;

	s->state = state;
	if (state == before || (before < 0 && state == CAN_STATE_ERROR_ACTIVE))
		return false;
	if (state == CAN_STATE_ERROR_PASSIVE)
		*controller |= CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
	else if (state == CAN_STATE_ERROR_WARNING)
		*controller |= CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
	else if (state == CAN_STATE_ERROR_ACTIVE)
		*controller |= CAN_ERR_CRTL_ACTIVE;
	return true;
}

static bool update_flags(struct slcan_status *s, uint8_t flags, struct can_frame *frame)
{
	uint8_t fresh = flags & ~s->flags, controller = 0;
	canid_t classes = 0;

	s->flags = flags;
	s->pending = false;
	s->answers = true;
	/* The flags have no bus-off: only adapters that send states report it and its end. */
	if (s->state != CAN_STATE_BUS_OFF &&
	    change_state(s,
			 flags & SLCAN_PASSIVE	 ? CAN_STATE_ERROR_PASSIVE
			 : flags & SLCAN_WARNING ? CAN_STATE_ERROR_WARNING
						 : CAN_STATE_ERROR_ACTIVE,
			 &controller))
		classes |= CAN_ERR_CRTL;
	if (fresh & (SLCAN_OVERRUN | SLCAN_RX_FULL)) {
		classes |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_RX_OVERFLOW;
	}
	if (fresh & SLCAN_TX_FULL) {
		classes |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_TX_OVERFLOW;
	}
	if (fresh & SLCAN_BUS_ERROR)
		classes |= CAN_ERR_BUSERROR;
	if (!classes)
		return false;
	make_error_frame(frame, classes, controller);
	return true;
}

static bool update_state(struct slcan_status *s, int state, struct can_frame *frame)
{
	bool was_off = s->state == CAN_STATE_BUS_OFF;
	uint8_t controller = 0;

	if (!change_state(s, state, &controller))
		return false;
	make_error_frame(frame,
			 (state == CAN_STATE_BUS_OFF ? CAN_ERR_BUSOFF : CAN_ERR_CRTL) |
				 (was_off ? CAN_ERR_RESTARTED : 0),
			 controller);
	return true;
}

/* The adapter refused a start command, a query or a frame. */
static bool update_refused(struct slcan_status *s, struct can_frame *frame)
{
	if (s->refusals) {
		s->refusals--;
		return false;
	}
	if (s->pending && !s->answers) {
		s->pending = false;
		s->refused_queries++;
		return false;
	}
	make_error_frame(frame, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW);
	return true;
}

bool slcan_status_update(struct slcan_status *s, enum slcan_kind kind,
			 const struct slcan_message *message, struct can_frame *frame)
{
	switch (kind) {
	case SLCAN_REFUSED:
		return update_refused(s, frame);
	case SLCAN_FLAGS:
		return update_flags(s, message->flags, frame);
	case SLCAN_STATE:
		return update_state(s, message->state, frame);
	default:
		return false;
	}
}
