// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan.c on a simulated kernel: the linker replaces its system calls
 * and the query for the interface by functions here. tests/vm/guest/can_bus.c runs on the real
 * kernel. The lock of a node is real, and so are its names on this machine.
 */
#include "../unit.h"
#include <poll.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include "../../../lib/device/can/bus/can_bus.h"
#include "../../../lib/device/can/bus/socketcan_netlink.h"

#define FD 7777
#define INDEX 42
#define S INT64_C(1000000000)

/* CAN interfaces, can0 and vcan…, and lo; and the errors to inject. */
static struct {
	int socket_error, option_error, bind_error, poll_error;
	int down, query_error;
	uint32_t bitrate;
	int state;
	int opened, bound;
	/* set by options */
	struct can_filter filter[64];
	int n_filters;
	can_err_mask_t errors;
	int overflow_on, timestamps, fd_frames;
	int mtu;
	/* send */
	int send_error, send_interrupts;
	struct can_frame sent;
	struct canfd_frame sent_fd;
	ssize_t send_takes;
	/* receive */
	int receive_error;
	struct can_frame frames[64];
	struct canfd_frame frame_fd; /* of size 72 */
	ssize_t size[64];
	struct timespec timestamp;
	uint32_t lost;
	int n_frames, next;
	/* clocks */
	int64_t now_ns, wall_ns;
	struct timespec slept;
} kernel;

int __real_socket(int domain, int type, int protocol);
int __real_close(int fd);
int __real_bind(int fd, const struct sockaddr *address, socklen_t size);
int __real_clock_gettime(clockid_t clock, struct timespec *t);

static int answer(int code)
{
	errno = code;
	return code ? -1 : 0;
}

int __wrap_socket(int domain, int type, int protocol)
{
	if (domain != PF_CAN)
		return __real_socket(domain, type, protocol);
	assert_int_equal(type, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK);
	assert_int_equal(protocol, CAN_RAW);
	if (kernel.socket_error)
		return answer(kernel.socket_error);
	kernel.opened++;
	return FD;
}

int __wrap_close(int fd)
{
	if (fd != FD)
		return __real_close(fd);
	kernel.opened--;
	return 0;
}

int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size)
{
	if (fd != FD)
		return __real_bind(fd, address, size);
	kernel.bound = ((const struct sockaddr_can *)address)->can_ifindex;
	return answer(kernel.bind_error);
}

int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size)
{
	assert_int_equal(fd, FD);
	if (kernel.option_error)
		return answer(kernel.option_error);
	if (level == SOL_CAN_RAW && name == CAN_RAW_FILTER) {
		kernel.n_filters = (int)(size / sizeof(struct can_filter));
		memcpy(kernel.filter, value, size);
	} else if (level == SOL_CAN_RAW && name == CAN_RAW_ERR_FILTER) {
		memcpy(&kernel.errors, value, size);
	} else if (level == SOL_SOCKET && name == SO_RXQ_OVFL) {
		memcpy(&kernel.overflow_on, value, size);
	} else if (level == SOL_SOCKET && name == SO_TIMESTAMPING) {
		memcpy(&kernel.timestamps, value, size);
	} else if (level == SOL_CAN_RAW && name == CAN_RAW_FD_FRAMES) {
		memcpy(&kernel.fd_frames, value, size);
	} else {
		return answer(ENOPROTOOPT);
	}
	return 0;
}

int __wrap_ioctl(int fd, unsigned long request, struct ifreq *link)
{
	assert_int_equal(fd, FD);
	assert_int_equal(request, SIOCGIFMTU);
	assert_string_equal(link->ifr_name, "can0");
	link->ifr_mtu = kernel.mtu;
	return 0;
}

/* can0 has an alternative name, adapter. */
int __wrap_can_netlink_query(const char *name, struct can_netlink *link)
{
	bool is_can0 = !strcmp(name, "can0") || !strcmp(name, "adapter");
	bool is_can = is_can0 || !strncmp(name, "vcan", 4);

	if (kernel.query_error)
		return -kernel.query_error;
	if (!is_can && strcmp(name, "lo") != 0)
		return -ENODEV;
	*link = (struct can_netlink){.index = INDEX,
				     .is_can = is_can,
				     .is_up = !kernel.down,
				     .state = -EOPNOTSUPP};
	strcpy(link->name, is_can0 ? "can0" : name);
	strcpy(link->kind, is_can0 ? "can" : is_can ? "vcan" : "");
	if (is_can0) {
		link->bitrate = kernel.bitrate;
		link->state = kernel.state;
	}
	return 0;
}

ssize_t __wrap_send(int fd, const void *bytes, size_t n, int flags)
{
	assert_int_equal(fd, FD);
	assert_true(n == CAN_MTU || (n == CANFD_MTU && kernel.fd_frames));
	assert_true(flags & MSG_DONTWAIT);
	if (kernel.send_interrupts-- > 0)
		return answer(EINTR);
	if (kernel.send_error)
		return answer(kernel.send_error);
	if (n == CANFD_MTU)
		memcpy(&kernel.sent_fd, bytes, n);
	else
		memcpy(&kernel.sent, bytes, n);
	return kernel.send_takes ? kernel.send_takes : (ssize_t)n;
}

ssize_t __wrap_recvmsg(int fd, struct msghdr *msg, int flags)
{
	struct scm_timestamping timestamps = {.ts = {kernel.timestamp}};
	struct cmsghdr *c;
	ssize_t n;

	assert_int_equal(fd, FD);
	assert_true(flags & MSG_DONTWAIT);
	if (kernel.next == kernel.n_frames)
		return answer(kernel.receive_error ? kernel.receive_error : EAGAIN);
	n = kernel.size[kernel.next] ? kernel.size[kernel.next]
				     : (ssize_t)sizeof(struct can_frame);
	if (n == CANFD_MTU)
		memcpy(msg->msg_iov->iov_base, &kernel.frame_fd, CANFD_MTU);
	else
		memcpy(msg->msg_iov->iov_base, &kernel.frames[kernel.next], CAN_MTU);
	kernel.next++;
	/* As the kernel does: the timestamp first, the loss only if there was one. */
	c = CMSG_FIRSTHDR(msg);
	c->cmsg_level = SOL_SOCKET;
	c->cmsg_type = SCM_TIMESTAMPING;
	c->cmsg_len = CMSG_LEN(sizeof(timestamps));
	memcpy(CMSG_DATA(c), &timestamps, sizeof(timestamps));
	memset((char *)c + CMSG_SPACE(sizeof(timestamps)), 0, sizeof(*c));
	if (!kernel.lost) {
		msg->msg_controllen = CMSG_SPACE(sizeof(timestamps));
		return n;
	}
	c = CMSG_NXTHDR(msg, c);
	assert_non_null(c);
	c->cmsg_level = SOL_SOCKET;
	c->cmsg_type = SO_RXQ_OVFL;
	c->cmsg_len = CMSG_LEN(sizeof(kernel.lost));
	memcpy(CMSG_DATA(c), &kernel.lost, sizeof(kernel.lost));
	msg->msg_controllen =
		CMSG_SPACE(sizeof(timestamps)) + CMSG_SPACE(sizeof(kernel.lost));
	return n;
}

int __wrap_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout,
		 const sigset_t *mask)
{
	assert_int_equal(n, 1);
	assert_int_equal(fds->fd, FD);
	assert_true(timeout->tv_sec >= 0 && timeout->tv_nsec >= 0 &&
		    timeout->tv_nsec < S);
	kernel.slept = *timeout;
	return answer(kernel.poll_error);
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
	int64_t ns = clock == CLOCK_REALTIME ? kernel.wall_ns : kernel.now_ns;

	*t = (struct timespec){ns / S, ns % S};
	return 0;
}

/* Names of owners are real: these are of this process. */
static char interface[IF_NAMESIZE];

static void kernel_init(void)
{
	snprintf(interface, sizeof(interface), "vcan%ld", (long)getpid());
	memset(&kernel, 0, sizeof(kernel));
	kernel.now_ns = 1000 * S;
	kernel.wall_ns = 1700000000 * S;
	kernel.bitrate = 1000000;
	kernel.state = CAN_STATE_ERROR_WARNING;
}

static int open_bus(struct can_bus **bus, const char *device, uint32_t bitrate,
		    uint8_t node, struct incise_error *err)
{
	const struct can_bus_request request = {.where = "rig.conf:1: stepper",
						.device = device,
						.bitrate = bitrate,
						.node = node};

	return can_transport_socketcan.open(bus, &request, err);
}

static struct can_bus *bus;

static int setup(void **state)
{
	kernel_init();
	return open_bus(&bus, "can0", 0, 0, &err);
}

static int teardown(void **state)
{
	bus->ops->close(bus);
	assert_int_equal(kernel.opened, 0);
	return 0;
}

/* The message has the place in rig.conf, and the interface or what to do. */
TEST(a_failed_open_has_a_message)
{
	static const struct {
		const char *device;
		uint32_t bitrate;
		int *where, what; /* goes wrong */
		int code;
		const char *words;
	} cases[] = {
		{"can0", 0, &kernel.socket_error, EAFNOSUPPORT, -EAFNOSUPPORT, "can_raw"},
		{"can0", 0, &kernel.socket_error, EPROTONOSUPPORT, -EAFNOSUPPORT,
		 "can_raw"},
		{"can0", 0, &kernel.socket_error, EPERM, -EACCES, "permission"},
		{"can0", 0, &kernel.socket_error, EMFILE, -EIO, "Too many"},
		{"can0", 0, &kernel.option_error, EINVAL, -EIO, "Invalid argument"},
		{"can0", 0, &kernel.bind_error, ENODEV, -ENODEV, "No such device"},
		{"can0", 0, &kernel.bind_error, ENETDOWN, -ENETDOWN, "Network is down"},
		{"nope", 0, NULL, 0, -ENODEV, "nope"},
		{"", 0, NULL, 0, -ENODEV, "interface"},
		{"can0", 0, &kernel.query_error, ENODEV, -ENODEV, "can0"},
		{"can0", 0, &kernel.query_error, ETIMEDOUT, -EIO, "can0: Connection"},
		{"can0", 0, &kernel.query_error, EBADMSG, -EIO, "can0: Bad message"},
		{"can0", 0, &kernel.query_error, ENOMEM, -ENOMEM, "can0: Cannot"},
		{"lo", 0, NULL, 0, -EINVAL, "lo"},
		{"can0", 0, &kernel.down, 1, -ENETDOWN,
		 "ip link set can0 up type can bitrate 1000000"},
		{"vcan0", 0, &kernel.down, 1, -ENETDOWN, "ip link set vcan0 up"},
		{"can0", 500000, NULL, 0, -EINVAL, "500000"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		int rc;

		kernel_init();
		if (cases[i].where)
			*cases[i].where = cases[i].what;
		rc = open_bus(&bus, cases[i].device, cases[i].bitrate, 0, &err);
		if (rc != cases[i].code || !strstr(err.text, cases[i].words))
			fail_msg("case %zu: %d: %s", i, rc, err.text);
		assert_int_equal(err.code, -rc);
		assert_int_equal(errno, -rc);
		assert_ptr_equal(strstr(err.text, "rig.conf:1: stepper: "), err.text);
		assert_int_equal(kernel.opened, 0);
	}
}

TEST(settings_are_those_of_the_kernel)
{
	static const struct {
		const char *device;
		uint32_t set, asked_for, bitrate;
		int state;
		const char *name;
	} cases[] = {
		{"can0", 1000000, 0, 1000000, CAN_STATE_ERROR_WARNING, "can0"},
		{"can0", 1000000, 1000000, 1000000, CAN_STATE_ERROR_WARNING, "can0"},
		{"can0", 0, 500000, 0, CAN_STATE_ERROR_WARNING, "can0"},
		{"adapter", 500000, 500000, 500000, CAN_STATE_ERROR_WARNING, "can0"},
		{"vcan0", 1000000, 500000, 0, -EOPNOTSUPP, "vcan0"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		kernel_init();
		kernel.bitrate = cases[i].set;
		assert_int_equal(
			open_bus(&bus, cases[i].device, cases[i].asked_for, 0, &err), 0);
		assert_int_equal(bus->bitrate, cases[i].bitrate);
		assert_int_equal(bus->ops->state(bus), cases[i].state);
		assert_string_equal(bus->name, cases[i].name);
		bus->ops->close(bus);
	}
}

TEST(the_socket_is_set_up, setup, teardown)
{
	assert_int_equal(kernel.bound, INDEX);
	assert_int_equal(kernel.errors, CAN_ERR_MASK);
	assert_int_equal(kernel.overflow_on, 1);
	assert_int_equal(kernel.timestamps,
			 SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE);
}

TEST(filters_are_the_kernels, setup, teardown)
{
	struct can_filter filter[CAN_BUS_FILTERS + 1] = {{0x190, 0xc00007ff}};

	assert_int_equal(bus->ops->filter(bus, filter, 3), 0);
	assert_int_equal(kernel.n_filters, 3);
	assert_memory_equal(kernel.filter, filter, 3 * sizeof(*filter));
	/* All: one filter that passes everything; without any the kernel passes nothing. */
	assert_int_equal(bus->ops->filter(bus, NULL, 0), 0);
	assert_int_equal(kernel.n_filters, 1);
	assert_int_equal(kernel.filter[0].can_mask, 0);
	assert_int_equal(bus->ops->filter(bus, filter, CAN_BUS_FILTERS), 0);
	assert_int_equal(bus->ops->filter(bus, filter, CAN_BUS_FILTERS + 1), -EINVAL);
	assert_int_equal(bus->ops->filter(bus, filter, -1), -EINVAL);
	kernel.option_error = ENOMEM;
	assert_int_equal(bus->ops->filter(bus, filter, 1), -ENOMEM);
}

TEST(sending_returns_its_errors, setup, teardown)
{
	struct can_frame frame = {.can_id = 0x210, .can_dlc = 8, .data = {1, 2, 3}};
	static const struct {
		int error, code;
	} cases[] = {
		{ENOBUFS, -ENOBUFS},
		{EAGAIN, -ENOBUFS},
		{EIO, -EIO},
		{EINVAL, -EIO},
		{0, 0},
		{ENETDOWN, -ENETDOWN},
		{0, -ENETDOWN},
	};

	kernel.send_interrupts = 2;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		kernel.send_error = cases[i].error;
		assert_int_equal(bus->ops->send(bus, &frame), cases[i].code);
	}
	assert_memory_equal(&kernel.sent, &frame, sizeof(frame));
	assert_int_equal(bus->counts.sent, 1);
	assert_int_equal(bus->counts.full, 2);
	assert_int_equal(bus->ops->wait(bus, INT64_MAX), -ENETDOWN);
	assert_int_equal(bus->ops->receive(bus, &frame, &kernel.now_ns), -ENETDOWN);
}

TEST(an_invalid_frame_is_not_sent, setup, teardown)
{
	struct can_frame frame = {.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF, .can_dlc = 8};

	assert_int_equal(bus->ops->send(bus, &frame), -EINVAL);
	frame.can_id = 0x210;
	frame.can_dlc = 9;
	assert_int_equal(bus->ops->send(bus, &frame), -EINVAL);
	frame.can_dlc = 8;
	kernel.send_takes = 4;
	assert_int_equal(bus->ops->send(bus, &frame), -EIO);
	kernel.send_takes = 0;
	kernel.send_error = ENXIO;
	assert_int_equal(bus->ops->send(bus, &frame), -ENODEV);
	assert_int_equal(bus->counts.sent, 0);
}

/* Receive a frame that arrived so long ago; returns its timestamp. */
static int64_t receive_aged(int64_t ago_ns)
{
	struct can_frame frame;
	int64_t t_ns = -1, wall_ns = kernel.wall_ns - ago_ns;

	kernel.timestamp = (struct timespec){wall_ns / S, wall_ns % S};
	kernel.n_frames = 1;
	kernel.next = 0;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), 1);
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), 0);
	return t_ns;
}

TEST(timestamps_are_monotonic, setup, teardown)
{
	int64_t now;

	kernel.now_ns += 10 * S;
	kernel.wall_ns += 10 * S;
	now = kernel.now_ns;
	assert_int_equal(receive_aged(3000), now - 3000);
	assert_int_equal(receive_aged(2000), now - 2000);
	/* Two processors set timestamps: the second frame is not before the first. */
	assert_int_equal(receive_aged(2500), now - 2000);
	/* The wall clock is set back, then far forward, with a frame in the queue. */
	assert_int_equal(receive_aged(-3600 * S), now);
	kernel.now_ns += S;
	assert_int_equal(receive_aged(3600 * S), now);
	assert_int_equal(receive_aged(1), now + S - 1);
	/* Without a timestamp: now. */
	assert_int_equal(receive_aged(kernel.wall_ns), now + S);
}

TEST(lost_frames_are_counted, setup, teardown)
{
	static const struct {
		uint32_t kernel;
		uint64_t counted;
	} cases[] = {{0, 0},
		     {5, 5},
		     {5, 5},
		     {9, 9},
		     {0xfffffff0u, 0xfffffff0u},
		     {0x10, 0x100000010},
		     {0x11, 0x100000011}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		kernel.lost = cases[i].kernel;
		receive_aged(0);
		assert_true(bus->counts.overflow == cases[i].counted);
	}
}

TEST(error_frames_set_the_state, setup, teardown)
{
	static const struct {
		canid_t id;
		uint8_t controller;
		int state;
	} cases[] = {
		{CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CAN_STATE_ERROR_PASSIVE},
		{CAN_ERR_ACK, 0, CAN_STATE_ERROR_PASSIVE},
		{CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, CAN_STATE_ERROR_PASSIVE},
		{CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING, CAN_STATE_ERROR_WARNING},
		{CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CAN_STATE_ERROR_ACTIVE},
		{CAN_ERR_BUSOFF | CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE,
		 CAN_STATE_BUS_OFF},
		{CAN_ERR_RESTARTED, 0, CAN_STATE_ERROR_ACTIVE},
		{CAN_ERR_BUSOFF, 0, CAN_STATE_BUS_OFF},
	};
	struct can_frame frame;
	int64_t t_ns;
	int n = sizeof(cases) / sizeof(*cases);

	for (int i = 0; i < n; i++) {
		kernel.frames[0] =
			(struct can_frame){.can_id = CAN_ERR_FLAG | cases[i].id,
					   .can_dlc = CAN_ERR_DLC,
					   .data = {0, cases[i].controller}};
		kernel.n_frames = 1;
		kernel.next = 0;
		assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), 1);
		assert_memory_equal(&frame, &kernel.frames[0], sizeof(frame));
		assert_int_equal(bus->ops->state(bus), cases[i].state);
	}
	assert_int_equal(bus->counts.errors, n);
	assert_int_equal(bus->counts.received, 0);
}

TEST(an_invalid_frame_is_skipped, setup, teardown)
{
	struct can_frame frame;
	int64_t t_ns;

	kernel.size[0] = 4;
	kernel.size[1] = 72; /* CAN FD */
	kernel.frames[2].can_dlc = 9;
	kernel.frames[3].can_id = 0x190;
	kernel.n_frames = 4;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), 1);
	assert_int_equal(frame.can_id, 0x190);
	assert_int_equal(bus->counts.broken, 3);
	assert_int_equal(bus->counts.received, 1);
	/* Not without end. */
	for (int i = 0; i < 64; i++)
		kernel.size[i] = 4;
	kernel.n_frames = 64;
	kernel.next = 0;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), 0);
	assert_true(kernel.next < 64);
}

/* A bus with CAN FD; NULL: refused. */
static struct can_bus *open_fd(int mtu)
{
	const struct can_bus_request request = {
		.where = "rig.conf:1: haptic", .device = "adapter", .fd = true};

	kernel_init();
	kernel.mtu = mtu;
	bus = NULL;
	return can_transport_socketcan.open(&bus, &request, &err) ? NULL : bus;
}

TEST(can_fd)
{
	struct canfd_frame frame = {.can_id = 0x8003 | CAN_EFF_FLAG,
				    .len = 64,
				    .flags = CANFD_BRS,
				    .data = {[0] = 1, [63] = 0x50}};
	struct canfd_frame got;
	int64_t t_ns;

	assert_null(open_fd(CAN_MTU));
	assert_non_null(strstr(err.text, "can0 takes no CAN FD frames; run ip link"));
	assert_int_equal(kernel.opened, 0);
	err = (struct incise_error){0};
	succeeds(open_fd(CANFD_MTU));
	assert_int_equal(kernel.fd_frames, 1);
	assert_int_equal(bus->ops->send_fd(bus, &frame), 0);
	assert_memory_equal(&kernel.sent_fd, &frame, sizeof(frame));
	frame.len = 65;
	assert_int_equal(bus->ops->send_fd(bus, &frame), -EINVAL);
	/* too long, whole, a classic one, an error frame */
	kernel.frame_fd = frame;
	kernel.size[0] = CANFD_MTU;
	kernel.n_frames = 1;
	assert_int_equal(bus->ops->receive_fd(bus, &got, &t_ns), 0);
	kernel.frame_fd.len = frame.len = 64;
	kernel.next = 0;
	kernel.frames[1] = (struct can_frame){.can_id = 0x100, .can_dlc = 8};
	kernel.frames[2] = (struct can_frame){.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF,
					      .can_dlc = CAN_ERR_DLC};
	kernel.n_frames = 3;
	assert_int_equal(bus->ops->receive_fd(bus, &got, &t_ns), 1);
	assert_memory_equal(&got, &frame, sizeof(frame));
	assert_int_equal(bus->ops->receive_fd(bus, &got, &t_ns), 1);
	assert_true(got.can_id == 0x100 && got.len == 8);
	assert_int_equal(bus->ops->receive_fd(bus, &got, &t_ns), 1);
	assert_int_equal(bus->ops->state(bus), CAN_STATE_BUS_OFF);
	bus->ops->close(bus);
}

TEST(receiving_finds_a_lost_interface, setup, teardown)
{
	struct can_frame frame;
	int64_t t_ns;

	kernel.receive_error = EIO;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), -EIO);
	kernel.receive_error = ENODEV;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), -ENODEV);
	/* Permanent, although the socket then reports no more errors. */
	kernel.receive_error = 0;
	assert_int_equal(bus->ops->receive(bus, &frame, &t_ns), -ENODEV);
	frame = (struct can_frame){.can_id = 0x080};
	assert_int_equal(bus->ops->send(bus, &frame), -ENODEV);
}

TEST(waiting_has_an_end, setup, teardown)
{
	int64_t now = kernel.now_ns;

	assert_int_equal(bus->ops->now(bus), now);
	assert_int_equal(bus->ops->wait(bus, now + 3 * S + 5), 0);
	assert_int_equal(kernel.slept.tv_sec, 3);
	assert_int_equal(kernel.slept.tv_nsec, 5);
	assert_int_equal(bus->ops->wait(bus, now - 1), 0);
	assert_int_equal(kernel.slept.tv_sec, 0);
	assert_int_equal(kernel.slept.tv_nsec, 0);
	assert_int_equal(bus->ops->wait(bus, INT64_MIN), 0);
	assert_int_equal(kernel.slept.tv_nsec, 0);
	assert_int_equal(bus->ops->wait(bus, INT64_MAX), 0);
	kernel.poll_error = EINTR;
	assert_int_equal(bus->ops->wait(bus, now + 1), -EINTR);
}

TEST(a_node_has_one_owner)
{
	struct can_bus *first, *second = NULL;
	char longer[sizeof(interface) + 1], name[64];

	kernel_init();
	assert_int_equal(open_bus(&first, interface, 0, 113, &err), 0);
	assert_int_equal(open_bus(&second, interface, 0, 113, &err), -EBUSY);
	assert_int_equal(err.code, EBUSY);
	assert_ptr_equal(strstr(err.text, "rig.conf:1: stepper: "), err.text);
	/* The message has the name that ss prints. */
	snprintf(name, sizeof(name), "@incise-can/%s/113)", interface);
	assert_non_null(strstr(err.text, name));
	assert_int_equal(kernel.opened, 1);
	/* Another interface, another node and a bus that only watches are free. */
	snprintf(longer, sizeof(longer), "%s1", interface);
	assert_int_equal(open_bus(&second, longer, 0, 113, &err), 0);
	second->ops->close(second);
	assert_int_equal(open_bus(&second, interface, 0, 11, &err), 0);
	second->ops->close(second);
	assert_int_equal(open_bus(&second, interface, 0, 0, &err), 0);
	second->ops->close(second);
	first->ops->close(first);
	assert_int_equal(open_bus(&first, interface, 0, 113, &err), 0);
	first->ops->close(first);
	assert_int_equal(kernel.opened, 0);
}

TEST(a_dead_process_owns_nothing)
{
	pid_t child;
	int status;

	kernel_init();
	child = fork();
	assert_true(child >= 0);
	if (!child)
		_exit(open_bus(&bus, interface, 0, 17, NULL) < 0);
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_int_equal(status, 0);
	assert_int_equal(open_bus(&bus, interface, 0, 17, &err), 0);
	bus->ops->close(bus);
}
