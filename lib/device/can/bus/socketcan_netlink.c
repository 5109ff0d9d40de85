// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Kind and settings of a CAN interface; see socketcan_netlink.h.
 *
 * The kernel answers before sendto() of the query returns. Where it cannot, because the
 * socket's queue is full, a time limit ends the wait.
 */
#include <errno.h>
#include <net/if_arp.h>
#include <string.h>
#include <sys/time.h>
#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include "../../../base/monotonic.h"
#include "socketcan_netlink.h"

#ifndef ARPHRD_CAN
#define ARPHRD_CAN 280 /* the C library has it since glibc 2.32 */
#endif
#define NS_PER_S INT64_C(1000000000)
#define WAIT_S 1
#define SEQUENCE 1 /* each query has a socket of its own */
/* An answer has some 1500 bytes, mostly counters, and at most 8 KiB. */
#define ANSWER_MAX 8192

typedef int read_attribute(struct can_netlink *link, const struct nlattr *attr);

/* Call @read for all attributes in @n bytes, which they must fill. */
static int walk(struct can_netlink *link, const void *bytes, size_t n,
		read_attribute *read)
{
	const char *end = (const char *)bytes + n;
	const struct nlattr *attr = bytes;

	while ((const char *)attr < end) {
		int rc;

		if (!mnl_attr_ok(attr, (int)(end - (const char *)attr)))
			return -EBADMSG;
		rc = read(link, attr);
		if (rc)
			return rc;
		attr = mnl_attr_next(attr);
	}
	return 0;
}

static int walk_nested(struct can_netlink *link, const struct nlattr *attr,
		       read_attribute *read)
{
	return walk(link, mnl_attr_get_payload(attr), mnl_attr_get_payload_len(attr),
		    read);
}

/* Longer text is cut off: the names that matter here all fit. */
static int read_text(char *text, size_t size, const struct nlattr *attr)
{
	size_t n;

	if (mnl_attr_validate(attr, MNL_TYPE_NUL_STRING) < 0)
		return -EBADMSG;
	n = strnlen(mnl_attr_get_str(attr), size - 1);
	memcpy(text, mnl_attr_get_str(attr), n);
	text[n] = '\0';
	return 0;
}

static int read_controller(struct can_netlink *link, const struct nlattr *attr)
{
	uint16_t size = mnl_attr_get_payload_len(attr);
	struct can_bittiming timing;

	switch (mnl_attr_get_type(attr)) {
	case IFLA_CAN_BITTIMING:
		/* A later kernel may append to it. */
		if (size < sizeof(timing))
			return -EBADMSG;
		memcpy(&timing, mnl_attr_get_payload(attr), sizeof(timing));
		/* All ones: unknown to the driver. */
		link->bitrate = timing.bitrate == UINT32_MAX ? 0 : timing.bitrate;
		return 0;
	case IFLA_CAN_STATE:
		if (size != sizeof(uint32_t))
			return -EBADMSG;
		if (mnl_attr_get_u32(attr) < CAN_STATE_MAX)
			link->state = (int)mnl_attr_get_u32(attr);
		return 0;
	default:
		return 0;
	}
}

static int read_kind(struct can_netlink *link, const struct nlattr *attr)
{
	if (mnl_attr_get_type(attr) != IFLA_INFO_KIND)
		return 0;
	return read_text(link->kind, sizeof(link->kind), attr);
}

/* The kind, which comes first, defines the meaning of the data. */
static int read_data(struct can_netlink *link, const struct nlattr *attr)
{
	if (mnl_attr_get_type(attr) != IFLA_INFO_DATA || strcmp(link->kind, "can") != 0)
		return 0;
	return walk_nested(link, attr, read_controller);
}

static int read_link(struct can_netlink *link, const struct nlattr *attr)
{
	int rc;

	switch (mnl_attr_get_type(attr)) {
	case IFLA_IFNAME:
		return read_text(link->name, sizeof(link->name), attr);
	case IFLA_LINKINFO:
		rc = walk_nested(link, attr, read_kind);
		return rc ? rc : walk_nested(link, attr, read_data);
	default:
		return 0;
	}
}

static int parse_link(const struct nlmsghdr *message, struct can_netlink *link)
{
	size_t n = mnl_nlmsg_get_payload_len(message);
	struct ifinfomsg info;
	int rc;

	*link = (struct can_netlink){.state = -EOPNOTSUPP};
	if (n < sizeof(info))
		return -EBADMSG;
	memcpy(&info, mnl_nlmsg_get_payload(message), sizeof(info));
	link->index = info.ifi_index;
	link->is_can = info.ifi_type == ARPHRD_CAN;
	link->is_up = info.ifi_flags & IFF_UP;
	rc = walk(link, mnl_nlmsg_get_payload_offset(message, sizeof(info)),
		  n - sizeof(info), read_link);
	if (!rc && (link->index <= 0 || !*link->name))
		rc = -EBADMSG;
	return rc ? rc : 1;
}

static int parse_error(const struct nlmsghdr *message)
{
	int code;

	if (mnl_nlmsg_get_payload_len(message) < sizeof(struct nlmsgerr))
		return -EBADMSG;
	memcpy(&code, mnl_nlmsg_get_payload(message), sizeof(code));
	/* 0 acknowledges, which is no answer. */
	return code < 0 && code > -4096 ? code : -EBADMSG;
}

int can_netlink_parse(const void *bytes, size_t n, uint32_t sequence, uint32_t port,
		      struct can_netlink *link)
{
	const struct nlmsghdr *message = bytes;
	int left = (int)n;

	while (left > 0) {
		/* libmnl takes a length above INT_MAX as negative, and so as valid. */
		if (!mnl_nlmsg_ok(message, left) || message->nlmsg_len > (size_t)left)
			return -EBADMSG;
		if (message->nlmsg_seq == sequence && message->nlmsg_pid == port) {
			if (message->nlmsg_type == NLMSG_ERROR)
				return parse_error(message);
			if (message->nlmsg_type == RTM_NEWLINK)
				return parse_link(message, link);
		}
		message = mnl_nlmsg_next(message, &left);
	}
	return 0;
}

static int send_query(const struct mnl_socket *socket, const char *name)
{
	union {
		struct nlmsghdr align;
		char bytes[NLMSG_SPACE(sizeof(struct ifinfomsg)) + NLA_HDRLEN +
			   IF_NAMESIZE];
	} buffer = {0};
	struct nlmsghdr *message = mnl_nlmsg_put_header(&buffer);

	message->nlmsg_type = RTM_GETLINK;
	message->nlmsg_flags = NLM_F_REQUEST;
	message->nlmsg_seq = SEQUENCE;
	mnl_nlmsg_put_extra_header(message, sizeof(struct ifinfomsg));
	mnl_attr_put_strz(message, IFLA_IFNAME, name);
	return mnl_socket_sendto(socket, message, message->nlmsg_len) < 0 ? -errno : 0;
}

/* Other messages and signals do not prolong the wait. */
static int receive_answer(const struct mnl_socket *socket, struct can_netlink *link)
{
	union {
		struct nlmsghdr align;
		char bytes[ANSWER_MAX];
	} buffer;
	int64_t end = incise_monotonic_ns() + WAIT_S * NS_PER_S;

	do {
		ssize_t n = mnl_socket_recvfrom(socket, &buffer, sizeof(buffer));
		int rc = 0;

		if (n >= 0)
			rc = can_netlink_parse(&buffer, (size_t)n, SEQUENCE,
					       mnl_socket_get_portid(socket), link);
		else if (errno == EAGAIN)
			return -ETIMEDOUT;
		else if (errno == ENOSPC) /* it was longer than the buffer */
			return -EBADMSG;
		else if (errno != EINTR)
			return -errno;
		if (rc)
			return rc < 0 ? rc : 0;
	} while (incise_monotonic_ns() < end);
	return -ETIMEDOUT;
}

static int query(struct mnl_socket *socket, const char *name, struct can_netlink *link)
{
	const struct timeval limit = {.tv_sec = WAIT_S};
	int rc;

	if (setsockopt(mnl_socket_get_fd(socket), SOL_SOCKET, SO_RCVTIMEO, &limit,
		       sizeof(limit)) < 0 ||
	    mnl_socket_bind(socket, 0, MNL_SOCKET_AUTOPID) < 0)
		return -errno;
	rc = send_query(socket, name);
	return rc ? rc : receive_answer(socket, link);
}

int can_netlink_query(const char *name, struct can_netlink *link)
{
	struct mnl_socket *socket;
	int rc;

	/* The kernel refuses such names with another error. */
	if (!*name || strlen(name) >= IF_NAMESIZE)
		return -ENODEV;
	socket = mnl_socket_open2(NETLINK_ROUTE, SOCK_CLOEXEC);
	if (!socket)
		return -errno;
	rc = query(socket, name, link);
	mnl_socket_close(socket);
	return rc;
}
