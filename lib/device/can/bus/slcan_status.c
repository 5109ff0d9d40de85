// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What an slcan adapter tells of its controller; see slcan_status.h.
 */
#include <errno.h>
#include <string.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "slcan_status.h"

#define ASK_NS 100000000
/* Questions that may be refused before no more are asked. */
#define ASKS_MAX 3

void slcan_status_begin(struct slcan_status *s, unsigned int refusals, int64_t now_ns)
{
	*s = (struct slcan_status){
		.state = -EOPNOTSUPP, .asked_ns = now_ns, .refusals = refusals};
}

bool slcan_status_due(const struct slcan_status *s, int64_t now_ns)
{
	return s->asks < ASKS_MAX && now_ns - s->asked_ns >= ASK_NS;
}

void slcan_status_asked(struct slcan_status *s, int64_t now_ns)
{
	s->asked_ns = now_ns;
	s->asking = true;
}

static void error_frame(struct can_frame *frame, canid_t what, uint8_t controller)
{
	memset(frame, 0, sizeof(*frame));
	frame->can_id = CAN_ERR_FLAG | what;
	frame->can_dlc = CAN_ERR_DLC;
	frame->data[1] = controller;
}

/* True: it is another one than before, and *controller says so as an error frame does. */
static bool state_is(struct slcan_status *s, int state, uint8_t *controller)
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

/* What is new in the status becomes an error frame. */
static bool take_flags(struct slcan_status *s, uint8_t flags, struct can_frame *frame)
{
	uint8_t fresh = flags & ~s->flags, controller = 0;
	canid_t what = 0;

	s->flags = flags;
	s->asking = false;
	s->answers = true;
	/* Bus-off is told by those that tell states: the flags do not know it. */
	if (s->state != CAN_STATE_BUS_OFF &&
	    state_is(s,
		     flags & SLCAN_PASSIVE   ? CAN_STATE_ERROR_PASSIVE
		     : flags & SLCAN_WARNING ? CAN_STATE_ERROR_WARNING
					     : CAN_STATE_ERROR_ACTIVE,
		     &controller))
		what |= CAN_ERR_CRTL;
	if (fresh & (SLCAN_OVERRUN | SLCAN_RX_FULL)) {
		what |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_RX_OVERFLOW;
	}
	if (fresh & SLCAN_TX_FULL) {
		what |= CAN_ERR_CRTL;
		controller |= CAN_ERR_CRTL_TX_OVERFLOW;
	}
	if (fresh & SLCAN_BUS_ERROR)
		what |= CAN_ERR_BUSERROR;
	if (!what)
		return false;
	error_frame(frame, what, controller);
	return true;
}

static bool take_state(struct slcan_status *s, int state, struct can_frame *frame)
{
	bool was_off = s->state == CAN_STATE_BUS_OFF;
	uint8_t controller = 0;

	if (!state_is(s, state, &controller))
		return false;
	error_frame(frame,
		    (state == CAN_STATE_BUS_OFF ? CAN_ERR_BUSOFF : CAN_ERR_CRTL) |
			    (was_off ? CAN_ERR_RESTARTED : 0),
		    controller);
	return true;
}

/* A frame was refused, or what was sent at the start, or a question that it does not know. */
static bool take_refusal(struct slcan_status *s, struct can_frame *frame)
{
	if (s->refusals) {
		s->refusals--;
		return false;
	}
	if (s->asking && !s->answers) {
		s->asking = false;
		s->asks++;
		return false;
	}
	error_frame(frame, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW);
	return true;
}

bool slcan_status_take(struct slcan_status *s, enum slcan_kind kind,
		       const struct slcan_told *told, struct can_frame *frame)
{
	switch (kind) {
	case SLCAN_REFUSED:
		return take_refusal(s, frame);
	case SLCAN_FLAGS:
		return take_flags(s, told->flags, frame);
	case SLCAN_STATE:
		return take_state(s, told->state, frame);
	default:
		return false;
	}
}
