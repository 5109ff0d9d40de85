// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A CAN bus of the kernel: a raw socket on can0, vcan0 …
 *
 *   controller ─▶ driver ─▶ exact filters ─▶ queue of the socket ─▶ receive
 *                   ╰─ timestamp, CLOCK_REALTIME ╰─ counts lost frames
 *
 * Kind, bit rate and state of the interface are read once, when it is opened; error frames
 * then update the state.
 *
 * The socket's queue has the kernel's default length, about 220 frames: 70 ms of a drive's
 * traffic at 1 kHz. The drive's deadman expires before that.
 */
#include <errno.h>
#include <poll.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include "../../../base/monotonic.h"
#include "can_bus.h"
#include "socketcan_netlink.h"

#define NS_PER_S INT64_C(1000000000)
#define SHORT_MAX 16 /* messages that are no frame, skipped in one call of receive */

struct socketcan {
	struct can_bus bus;
	int fd;
	bool fd_frames;	 /* takes CAN FD */
	int owner;	 /* socket that holds the node; -1: no socket */
	int gone;	 /* -ENETDOWN, -ENODEV; permanent */
	int state;	 /* enum can_state; -EOPNOTSUPP: unknown */
	uint32_t lost;	 /* the kernel's count, modulo 2^32 */
	int64_t last_ns; /* timestamp of the last frame */
};

static struct socketcan *socketcan_of(struct can_bus *bus)
{
	return (struct socketcan *)bus;
}

static INCISE_REALTIME int64_t socketcan_now(struct can_bus *bus)
{
	(void)bus;
	return incise_monotonic_ns();
}

static int failed_socketcan(struct socketcan *s, int code)
{
	/* A socket whose interface is gone is not bound any more: ENXIO. */
	if (code == ENODEV || code == ENXIO)
		s->gone = -ENODEV;
	else if (code == ENETDOWN)
		s->gone = -ENETDOWN;
	else
		return -EIO;
	return s->gone;
}

/* A frame of either kind, which @size tells. */
static int send_one(struct can_bus *bus, const void *frame, size_t size)
{
	struct socketcan *s = socketcan_of(bus);
	ssize_t n;

	if (s->gone)
		return s->gone;
	do
		n = send(s->fd, frame, size, MSG_DONTWAIT);
	while (n < 0 && errno == EINTR);
	if (n == (ssize_t)size) {
		bus->counts.sent++;
		return 0;
	}
	if (n >= 0)
		return -EIO;
	/* The interface's queue is full, or the socket's share of it. */
	if (errno == ENOBUFS || errno == EAGAIN) {
		bus->counts.full++;
		return -ENOBUFS;
	}
	return failed_socketcan(s, errno);
}

static int socketcan_send(struct can_bus *bus, const struct can_frame *frame)
{
	return frame->can_id & CAN_ERR_FLAG || frame->can_dlc > CAN_MAX_DLEN
		       ? -EINVAL
		       : send_one(bus, frame, sizeof(*frame));
}

static int socketcan_send_fd(struct can_bus *bus, const struct canfd_frame *frame)
{
	return frame->can_id & CAN_ERR_FLAG || frame->len > CANFD_MAX_DLEN
		       ? -EINVAL
		       : send_one(bus, frame, sizeof(*frame));
}

/* Timestamps are wall time, which may be set meanwhile: an impossible one counts as now. */
static int64_t timestamp(struct socketcan *s, const struct timespec *wall)
{
	int64_t now = incise_monotonic_ns(), t = now;

	if (wall->tv_sec || wall->tv_nsec) {
		int64_t age = incise_read_clock_ns(CLOCK_REALTIME) -
			      (wall->tv_sec * NS_PER_S + wall->tv_nsec);

		if (age > 0)
			t = now - age;
	}
	s->last_ns = t > s->last_ns ? t : s->last_ns;
	return s->last_ns;
}

static void note_state(struct socketcan *s, const struct canfd_frame *frame)
{
	if (s->state == -EOPNOTSUPP)
		return;
	if (frame->can_id & CAN_ERR_RESTARTED)
		s->state = CAN_STATE_ERROR_ACTIVE;
	if (frame->can_id & CAN_ERR_CRTL) {
		uint8_t controller = frame->data[1];

		if (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE))
			s->state = CAN_STATE_ERROR_PASSIVE;
		else if (controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING))
			s->state = CAN_STATE_ERROR_WARNING;
		else if (controller & CAN_ERR_CRTL_ACTIVE)
			s->state = CAN_STATE_ERROR_ACTIVE;
	}
	if (frame->can_id & CAN_ERR_BUSOFF)
		s->state = CAN_STATE_BUS_OFF;
}

/* Read one message; returns as recvmsg(). *wall: its timestamp, 0 without one. */
static ssize_t read_one(struct socketcan *s, struct canfd_frame *frame,
			struct timespec *wall)
{
	union {
		char bytes[CMSG_SPACE(sizeof(struct scm_timestamping)) +
			   CMSG_SPACE(sizeof(uint32_t)) + 64];
		struct cmsghdr align;
	} control;
	struct iovec iov = {frame, sizeof(*frame)};
	struct msghdr msg = {.msg_iov = &iov,
			     .msg_iovlen = 1,
			     .msg_control = &control,
			     .msg_controllen = sizeof(control)};
	ssize_t n;

	memset(wall, 0, sizeof(*wall));
	do
		n = recvmsg(s->fd, &msg, MSG_DONTWAIT);
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return n;
	for (struct cmsghdr *c = CMSG_FIRSTHDR(&msg); c; c = CMSG_NXTHDR(&msg, c)) {
		if (c->cmsg_level != SOL_SOCKET)
			continue;
		if (c->cmsg_type == SO_RXQ_OVFL &&
		    c->cmsg_len >= CMSG_LEN(sizeof(uint32_t))) {
			uint32_t lost;

			memcpy(&lost, CMSG_DATA(c), sizeof(lost));
			s->bus.counts.overflow += (uint32_t)(lost - s->lost);
			s->lost = lost;
		} else if (c->cmsg_type == SCM_TIMESTAMPING &&
			   c->cmsg_len >= CMSG_LEN(sizeof(*wall))) {
			/* The first of three is the software timestamp. */
			memcpy(wall, CMSG_DATA(c), sizeof(*wall));
		}
	}
	return n;
}

static bool is_frame(const struct socketcan *s, const struct canfd_frame *frame,
		     ssize_t n)
{
	return n == CAN_MTU
		       ? frame->len <= CAN_MAX_DLEN
		       : s->fd_frames && n == CANFD_MTU && frame->len <= CANFD_MAX_DLEN;
}

static int socketcan_receive_fd(struct can_bus *bus, struct canfd_frame *frame,
				int64_t *t_ns)
{
	struct socketcan *s = socketcan_of(bus);

	if (s->gone)
		return s->gone;
	for (int i = 0; i < SHORT_MAX; i++) {
		struct timespec wall;
		ssize_t n = read_one(s, frame, &wall);

		if (n < 0)
			return errno == EAGAIN ? 0 : failed_socketcan(s, errno);
		if (!is_frame(s, frame, n)) {
			bus->counts.broken++;
			continue;
		}
		*t_ns = timestamp(s, &wall);
		if (frame->can_id & CAN_ERR_FLAG) {
			bus->counts.errors++;
			note_state(s, frame);
		} else {
			bus->counts.received++;
		}
		return 1;
	}
	return 0;
}

static int socketcan_receive(struct can_bus *bus, struct can_frame *frame, int64_t *t_ns)
{
	struct canfd_frame any;
	int rc = socketcan_receive_fd(bus, &any, t_ns);

	/* The begin of the one is the other. */
	if (rc > 0)
		memcpy(frame, &any, sizeof(*frame));
	return rc;
}

static int socketcan_wait(struct can_bus *bus, int64_t until_ns)
{
	struct socketcan *s = socketcan_of(bus);
	struct pollfd poll = {.fd = s->fd, .events = POLLIN};
	int64_t now = socketcan_now(bus), left = until_ns > now ? until_ns - now : 0;
	struct timespec timeout = {left / NS_PER_S, left % NS_PER_S};

	if (s->gone)
		return s->gone;
	return ppoll(&poll, 1, &timeout, NULL) < 0 ? -errno : 0;
}

static int socketcan_filter(struct can_bus *bus, const struct can_filter *filter, int n)
{
	/* A filter that passes everything: without any, the kernel passes nothing. */
	static const struct can_filter all = {0};

	if (n < 0 || n > CAN_BUS_FILTERS)
		return -EINVAL;
	if (!n)
		filter = &all;
	return setsockopt(socketcan_of(bus)->fd, SOL_CAN_RAW, CAN_RAW_FILTER, filter,
			  (socklen_t)((n ? (size_t)n : 1) * sizeof(*filter))) < 0
		       ? -errno
		       : 0;
}

static int socketcan_state(struct can_bus *bus)
{
	return socketcan_of(bus)->state;
}

static void socketcan_close(struct can_bus *bus)
{
	struct socketcan *s = socketcan_of(bus);

	if (s->fd >= 0)
		close(s->fd);
	if (s->owner >= 0)
		close(s->owner);
	free(s);
}

static const struct can_bus_ops socketcan_ops = {
	.now = socketcan_now,
	.send = socketcan_send,
	.receive = socketcan_receive,
	.send_fd = socketcan_send_fd,
	.receive_fd = socketcan_receive_fd,
	.wait = socketcan_wait,
	.filter = socketcan_filter,
	.state = socketcan_state,
	.close = socketcan_close,
};

/* Compare the interface's bit rate with the requested one. */
static int check_rate(struct socketcan *s, const struct can_bus_request *request,
		      struct incise_error *err)
{
	const char *name = s->bus.name;

	if (!request->bitrate || !s->bus.bitrate || request->bitrate == s->bus.bitrate)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: %s runs at %u bit/s, but bitrate is %u; correct it, or run ip "
		"link set %s down, then ip link set %s up type can bitrate %u",
		request->where, name, s->bus.bitrate, request->bitrate, name, name,
		request->bitrate);
}

static int refuse_query(const struct can_bus_request *request, int code,
			struct incise_error *err)
{
	if (code == ENODEV)
		return incise_error_set(
			err, ENODEV,
			"%s: no such interface %.40s; plug in the adapter and load its "
			"driver, then ip link set can0 up type can bitrate 1000000; ip "
			"-br link lists the interfaces",
			request->where, request->device);
	return incise_error_set(err, code == ENOMEM ? ENOMEM : EIO,
				"%s: the kernel has no information on %s: %s",
				request->where, request->device, strerror(code));
}

/* Returns the interface's index, or -errno with a message. */
static int look_up(struct socketcan *s, const struct can_bus_request *request,
		   struct incise_error *err)
{
	const char *where = request->where, *name = request->device;
	struct can_netlink link;
	int rc = can_netlink_query(name, &link);

	if (rc)
		return refuse_query(request, -rc, err);
	if (!link.is_can)
		return incise_error_set(
			err, EINVAL,
			"%s: %s is not a CAN interface; ip -br link show type can "
			"lists them",
			where, name);
	if (!link.is_up)
		return incise_error_set(
			err, ENETDOWN, "%s: %s is down: ip link set %s up%s", where, name,
			name,
			strcmp(link.kind, "can") ? "" : " type can bitrate 1000000");
	memcpy(s->bus.name, link.name, sizeof(link.name));
	s->bus.bitrate = link.bitrate;
	s->state = link.state;
	rc = check_rate(s, request, err);
	return rc ? rc : link.index;
}

/* An interface takes CAN FD frames if its largest frame is one. */
static int require_fd(struct socketcan *s, const struct can_bus_request *request,
		      struct incise_error *err)
{
	static const int on = 1;
	const char *name = s->bus.name;
	struct ifreq link = {0};

	snprintf(link.ifr_name, sizeof(link.ifr_name), "%.15s", name);
	s->fd_frames =
		!ioctl(s->fd, SIOCGIFMTU, &link) && link.ifr_mtu == CANFD_MTU &&
		!setsockopt(s->fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on));
	if (s->fd_frames)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: %s takes no CAN FD frames; run ip link set %s down, then ip link "
		"set %s up type can bitrate 1000000 dbitrate 5000000 fd on",
		request->where, name, name, name);
}

static int set_up_socketcan(struct socketcan *s, const struct can_bus_request *request,
			    int index, struct incise_error *err)
{
	static const int on = 1, timestamps = SOF_TIMESTAMPING_RX_SOFTWARE |
					      SOF_TIMESTAMPING_SOFTWARE;
	static const can_err_mask_t errors = CAN_ERR_MASK;
	struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = index};
	int code;

	if (setsockopt(s->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) ||
	    setsockopt(s->fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on)) ||
	    setsockopt(s->fd, SOL_SOCKET, SO_TIMESTAMPING, &timestamps,
		       sizeof(timestamps)) ||
	    bind(s->fd, (struct sockaddr *)&address, sizeof(address))) {
		code = errno == ENODEV ? ENODEV : errno == ENETDOWN ? ENETDOWN : EIO;
		return incise_error_set(err, code, "%s: %s: %s", request->where,
					request->device, strerror(errno));
	}
	return request->fd ? require_fd(s, request, err) : 0;
}

/*
 * A CAN socket keeps no other program out. The owner of a node binds a name,
 * "@incise-can/can0/16", which ends with the process and belongs to the same network
 * namespace as the interface. Returns its descriptor; closing that releases the node.
 */
static int own_node(const char *interface, uint8_t node, const char *where,
		    struct incise_error *err)
{
	struct sockaddr_un name = {.sun_family = AF_UNIX};
	int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0), code, n;

	if (fd < 0)
		return incise_error_set(err, EIO, "%s: socket: %s", where,
					strerror(errno));
	n = snprintf(name.sun_path + 1, sizeof(name.sun_path) - 1, "incise-can/%.40s/%u",
		     interface, node);
	if (!bind(fd, (struct sockaddr *)&name,
		  (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)n)))
		return fd;
	code = errno;
	close(fd);
	if (code == EADDRINUSE)
		return incise_error_set(
			err, EBUSY,
			"%s: another program drives it; end it first (ss -xap shows "
			"the one with @%s)",
			where, name.sun_path + 1);
	return incise_error_set(err, EIO, "%s: bind: %s", where, strerror(code));
}

static int open_socket(struct socketcan *s, const struct can_bus_request *request,
		       struct incise_error *err)
{
	s->fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
	if (s->fd >= 0)
		return 0;
	switch (errno) {
	case EAFNOSUPPORT:
	case EPROTONOSUPPORT:
		return incise_error_set(
			err, EAFNOSUPPORT,
			"%s: this kernel has no CAN sockets; run modprobe can_raw%s",
			request->where,
			request->fd ? ""
				    : ", or use a serial adapter as slcan:/dev/ttyACM0");
	case EACCES:
	case EPERM:
		return incise_error_set(err, EACCES,
					"%s: no permission to open a CAN "
					"socket",
					request->where);
	default:
		return incise_error_set(err, errno == ENOMEM ? ENOMEM : EIO,
					"%s: CAN socket: %s", request->where,
					strerror(errno));
	}
}

static int socketcan_open(struct can_bus **bus, const struct can_bus_request *request,
			  struct incise_error *err)
{
	struct socketcan *s = calloc(1, sizeof(*s));
	int index, rc;

	if (!s)
		return incise_error_set(err, ENOMEM, "%s: out of memory", request->where);
	s->bus.ops = &socketcan_ops;
	s->fd = s->owner = -1;
	s->state = -EOPNOTSUPP;
	s->last_ns = incise_monotonic_ns();
	rc = open_socket(s, request, err);
	if (!rc) {
		index = look_up(s, request, err);
		rc = index < 0 ? index : 0;
	}
	if (!rc && request->node) {
		s->owner = own_node(s->bus.name, request->node, request->where, err);
		rc = s->owner < 0 ? s->owner : 0;
	}
	if (!rc)
		rc = set_up_socketcan(s, request, index, err);
	if (rc) {
		socketcan_close(&s->bus);
		errno = -rc;
		return rc;
	}
	*bus = &s->bus;
	return 0;
}

const struct can_transport can_transport_socketcan = {.name = "can",
						      .open = socketcan_open};
