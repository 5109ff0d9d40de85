/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the kernel tells of a CAN interface, asked once, over rtnetlink:
 *
 *   RTM_GETLINK, its name ─▶ kernel ─▶ RTM_NEWLINK: number, type, flags
 *                                        ╰─ kind ─ of "can" also: rate, state, restart
 *                                      or NLMSG_ERROR: -ENODEV …
 *
 * "can" is a controller with a driver of its own. "vcan" and "vxcan" have none, and so no
 * bit rate and no state.
 */
#ifndef INCISE_CAN_NETLINK_H
#define INCISE_CAN_NETLINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <net/if.h>

struct can_netlink {
	char name[IF_NAMESIZE]; /* its own, where it was asked by another one */
	char kind[16];		/* "can", "vcan" …; "": it has none */
	int index;
	bool is_can, is_up;
	uint32_t bitrate;    /* bit/s; 0: there is none, or the driver does not know it */
	uint32_t restart_ms; /* it leaves bus-off by itself after so long; 0: not */
	int state;	     /* enum can_state; -EOPNOTSUPP: not told */
};

/*
 * Waits 2 s at most. 0; -ENODEV (there is none of that name), -ETIMEDOUT, -EBADMSG (the
 * answer is cut off, or an attribute has not the size of its type), or what the kernel says.
 */
int can_netlink_ask(const char *name, struct can_netlink *told);

/*
 * One datagram. 1 (*told is the answer), 0 (nothing in it is for us), or as above.
 * @bytes is aligned as a struct nlmsghdr.
 */
int can_netlink_parse(const void *bytes, size_t n, uint32_t sequence, uint32_t port,
		      struct can_netlink *told);

#endif
