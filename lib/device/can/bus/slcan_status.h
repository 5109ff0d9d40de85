/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What an slcan adapter tells of its controller, as error frames of linux/can/error.h:
 *
 *   F ─▶ adapter ─▶ F80, saXXXYYY or BEL ─▶ what is new of it: an error frame
 *
 * The question goes out with a frame, each 100 ms; who does not know it is soon left alone.
 */
#ifndef INCISE_SLCAN_STATUS_H
#define INCISE_SLCAN_STATUS_H

#include <stdbool.h>
#include <stdint.h>
#include <linux/can.h>
#include "slcan_line.h"

struct slcan_status {
	int state; /* enum can_state; -EOPNOTSUPP: it never told */

	/* private */
	uint8_t flags;
	int64_t asked_ns;
	unsigned int asks;     /* refused */
	bool asking, answers;  /* a question is open; one was answered once */
	unsigned int refusals; /* that may come of the start */
};

/* @refusals: as many commands of the start may be refused, such as C of what is closed. */
void slcan_status_begin(struct slcan_status *status, unsigned int refusals,
			int64_t now_ns);

/* Whether it is time to ask, and that it was asked. */
bool slcan_status_due(const struct slcan_status *status, int64_t now_ns);
void slcan_status_asked(struct slcan_status *status, int64_t now_ns);

/* SLCAN_REFUSED, SLCAN_FLAGS or SLCAN_STATE. True: *frame is an error frame that says so. */
bool slcan_status_take(struct slcan_status *status, enum slcan_kind kind,
		       const struct slcan_told *told, struct can_frame *frame);

#endif
