/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Who drives a node of an interface: one program at a time, as a CAN socket keeps nobody
 * out. The owner has bound a name, "@incise-can/can0/16", which goes with the process and
 * is of the same network namespace as the interface.
 */
#ifndef INCISE_CAN_OWNER_H
#define INCISE_CAN_OWNER_H

#include <stdint.h>
#include <incise/error.h>

/* A descriptor, which to close gives the node back. -EBUSY, -EIO; @where begins the line. */
int can_owner_take(const char *interface, uint8_t node, const char *where,
		   struct incise_error *err);

#endif
