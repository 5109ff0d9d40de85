/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Kind and settings of a CAN interface, queried once over rtnetlink:
 *
 *   RTM_GETLINK, its name ─▶ kernel ─▶ RTM_NEWLINK: number, type, flags
 *                                        ╰─ kind; for "can" also rate, state, restart
 *                                      or NLMSG_ERROR: -ENODEV …
 *
 * "can" is a controller with a driver. "vcan" and "vxcan" have no bit rate and no state.
 */
#ifndef INCISE_CAN_NETLINK_H
#define INCISE_CAN_NETLINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <net/if.h>

struct can_netlink {
	char name[IF_NAMESIZE]; /* its own, also where @name was an alternative name */
	char kind[16];		/* "can", "vcan" …; "": no kind */
	int index;
	bool is_can, is_up;
	uint32_t bitrate; /* bit/s; 0: no bit rate, or unknown to the driver */
	int state;	  /* enum can_state; -EOPNOTSUPP: not reported */
};

/*
 * Waits 2 s at most. Returns 0; -ENODEV (no such name), -ETIMEDOUT, -EBADMSG (the answer is
 * cut off, or an attribute has not the size of its type), or the kernel's error.
 */
int can_netlink_query(const char *name, struct can_netlink *link);

/*
 * Parse one datagram. Returns 1 (*link is the answer), 0 (no message in it is the answer), or
 * an error as above. @bytes is aligned as a struct nlmsghdr.
 */
int can_netlink_parse(const void *bytes, size_t n, uint32_t sequence, uint32_t port,
		      struct can_netlink *link);

#endif
