/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Looking at a drive that another program may be driving: nothing is written to it. While
 * that one sends SYNCs its TPDOs are listened to, else the drive is asked by SDO.
 */
#ifndef INCISE_CAN_WATCH_H
#define INCISE_CAN_WATCH_H

#include "can_session.h"

struct can_watch {
	int64_t heard_ns; /* the last TPDO1 */
	int64_t looked_ns;
	double position; /* steps, then */
};

/* A look; status goes into the link's axis and its slot. Some ms at most, and 1 s where the
 * drive does not answer. */
void can_watch_cycle(struct can_watch *watch, struct can_link *link);

#endif
