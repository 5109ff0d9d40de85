// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan_netlink.c on answers composed here byte by byte, and on
 * the kernel's answer for lo. tests/vm/guest/can_bus.sh queries a real controller.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include "../../../lib/device/can/bus/socketcan_netlink.h"

#define PORT 4711
#define SEQUENCE 1
#define S INT64_C(1000000000)

/* A datagram; all is appended at its end. */
struct datagram {
	_Alignas(struct nlmsghdr) unsigned char bytes[1024];
	size_t n;
};

static size_t append(struct datagram *d, const void *bytes, size_t n)
{
	size_t at = d->n;

	assert_true(at + NLMSG_ALIGN(n) <= sizeof(d->bytes));
	memcpy(d->bytes + at, bytes, n);
	d->n += NLMSG_ALIGN(n);
	return at;
}

static size_t message_begin(struct datagram *d, uint16_t type, uint32_t sequence,
			    uint32_t port)
{
	const struct nlmsghdr header = {
		.nlmsg_type = type, .nlmsg_seq = sequence, .nlmsg_pid = port};

	return append(d, &header, sizeof(header));
}

static void message_end(struct datagram *d, size_t at)
{
	uint32_t size = (uint32_t)(d->n - at);

	memcpy(d->bytes + at, &size, sizeof(size));
}

static size_t attribute(struct datagram *d, uint16_t type, const void *bytes, size_t n)
{
	const struct nlattr header = {(uint16_t)(NLA_HDRLEN + n), type};
	size_t at = append(d, &header, sizeof(header));

	if (n)
		append(d, bytes, n);
	return at;
}

static void nest_end(struct datagram *d, size_t at)
{
	uint16_t size = (uint16_t)(d->n - at);

	memcpy(d->bytes + at, &size, sizeof(size));
}

/* Attributes of an interface; wrong sizes of them where not 0. */
struct interface {
	const char *name, *kind;
	uint16_t type;
	int index;
	unsigned int flags;
	uint32_t bitrate, restart_ms, state;
	size_t timing_size, restart_size, state_size;
	size_t nest; /* to write in place of that of the controller's */
	bool no_data, data_first, open_kind;
};

static const struct interface can0 = {.name = "can0",
				      .kind = "can",
				      .type = ARPHRD_CAN,
				      .index = 5,
				      .flags = IFF_UP | IFF_RUNNING,
				      .bitrate = 500000,
				      .restart_ms = 100,
				      .state = CAN_STATE_ERROR_PASSIVE};

static void put_data(struct datagram *d, const struct interface *i)
{
	struct {
		struct can_bittiming timing;
		uint32_t later[2];
	} timing = {.timing = {.bitrate = i->bitrate}};
	const uint32_t restart_ms[2] = {i->restart_ms}, state[2] = {i->state};
	const struct can_clock clock = {24000000};
	size_t at = attribute(d, IFLA_INFO_DATA | NLA_F_NESTED, NULL, 0);
	uint16_t size = (uint16_t)i->nest;

	attribute(d, IFLA_CAN_BITTIMING, &timing,
		  i->timing_size ? i->timing_size : sizeof(timing.timing));
	attribute(d, IFLA_CAN_CLOCK, &clock, sizeof(clock));
	attribute(d, IFLA_CAN_STATE, state, i->state_size ? i->state_size : 4);
	attribute(d, IFLA_CAN_RESTART_MS, restart_ms,
		  i->restart_size ? i->restart_size : 4);
	nest_end(d, at);
	if (size)
		memcpy(d->bytes + at, &size, sizeof(size));
}

static void put_link(struct datagram *d, const struct interface *i, uint32_t sequence,
		     uint32_t port)
{
	const struct ifinfomsg link = {
		.ifi_type = i->type, .ifi_index = i->index, .ifi_flags = i->flags};
	size_t at = message_begin(d, RTM_NEWLINK, sequence, port), info;
	static const unsigned char counters[96];

	append(d, &link, sizeof(link));
	attribute(d, IFLA_IFNAME, i->name, strlen(i->name) + 1);
	attribute(d, IFLA_STATS, counters, sizeof(counters));
	if (i->kind) {
		info = attribute(d, IFLA_LINKINFO, NULL, 0);
		if (i->data_first)
			put_data(d, i);
		attribute(d, IFLA_INFO_KIND, i->kind, strlen(i->kind) + !i->open_kind);
		if (!i->data_first && !i->no_data)
			put_data(d, i);
		nest_end(d, info);
	}
	attribute(d, IFLA_GROUP, &(uint32_t){0}, 4);
	message_end(d, at);
}

static void put_error(struct datagram *d, int code, uint32_t sequence, uint32_t port)
{
	const struct nlmsgerr error = {.error = code};
	size_t at = message_begin(d, NLMSG_ERROR, sequence, port);

	append(d, &error, sizeof(error));
	message_end(d, at);
}

/* Parse a copy in memory that ends with the datagram, to find reads behind it. */
static int parse(const void *bytes, size_t n, struct can_netlink *link)
{
	void *copy = malloc(n ? n : 1);
	int rc;

	assert_non_null(copy);
	memcpy(copy, bytes, n);
	rc = can_netlink_parse(copy, n, SEQUENCE, PORT, link);
	free(copy);
	return rc;
}

static int parse_interface(const struct interface *i, struct can_netlink *link)
{
	struct datagram d = {.n = 0};

	put_link(&d, i, SEQUENCE, PORT);
	return parse(d.bytes, d.n, link);
}

static void a_controller_is_told(void **state)
{
	struct interface i = can0;
	struct can_netlink link;

	for (int n = 0; n < 2; n++) {
		assert_int_equal(parse_interface(&i, &link), 1);
		assert_string_equal(link.name, "can0");
		assert_string_equal(link.kind, "can");
		assert_int_equal(link.index, 5);
		assert_true(link.is_can && link.is_up);
		assert_int_equal(link.bitrate, 500000);
		assert_int_equal(link.restart_ms, 100);
		assert_int_equal(link.state, CAN_STATE_ERROR_PASSIVE);
		/* In any order. */
		i.data_first = true;
	}
}

static void what_is_not_known_is_not_made_up(void **state)
{
	struct interface i = can0;
	struct can_netlink link;

	i.bitrate = UINT32_MAX;
	i.state = CAN_STATE_MAX;
	i.flags = 0;
	assert_int_equal(parse_interface(&i, &link), 1);
	assert_int_equal(link.bitrate, 0);
	assert_int_equal(link.state, -EOPNOTSUPP);
	assert_false(link.is_up);
	i = can0;
	i.no_data = true;
	assert_int_equal(parse_interface(&i, &link), 1);
	assert_int_equal(link.bitrate, 0);
	assert_int_equal(link.restart_ms, 0);
	assert_int_equal(link.state, -EOPNOTSUPP);
}

/* Their data is not a controller's, though the numbers of its attributes are the same. */
static void other_kinds_tell_no_rate(void **state)
{
	static const struct {
		const char *kind;
		uint16_t type;
		const char *is;
	} cases[] = {
		{"vcan", ARPHRD_CAN, "vcan"},
		{"vxcan", ARPHRD_CAN, "vxcan"},
		{NULL, ARPHRD_CAN, ""},
		{"vlan", ARPHRD_ETHER, "vlan"},
		{"a-kind-of-more-than-15-bytes", ARPHRD_ETHER, "a-kind-of-more-"},
	};

	for (size_t n = 0; n < sizeof(cases) / sizeof(*cases); n++) {
		struct interface i = can0;
		struct can_netlink link;

		i.kind = cases[n].kind;
		i.type = cases[n].type;
		i.state_size = 1;
		assert_int_equal(parse_interface(&i, &link), 1);
		assert_string_equal(link.kind, cases[n].is);
		assert_int_equal(link.is_can, cases[n].type == ARPHRD_CAN);
		assert_int_equal(link.bitrate, 0);
		assert_int_equal(link.restart_ms, 0);
		assert_int_equal(link.state, -EOPNOTSUPP);
	}
}

static void what_has_not_its_size_is_refused(void **state)
{
	struct interface cases[] = {can0, can0, can0, can0, can0, can0,
				    can0, can0, can0, can0, can0};
	size_t n = sizeof(cases) / sizeof(*cases);
	struct can_netlink link;

	cases[0].timing_size = sizeof(struct can_bittiming) - 1;
	cases[1].timing_size = 4;
	cases[2].state_size = 3;
	cases[3].state_size = 5;
	cases[4].restart_size = 2;
	cases[5].restart_size = 8;
	cases[6].nest = 3;   /* less than its own header */
	cases[7].nest = 999; /* more than there is */
	cases[8].nest = 43;  /* ends within an attribute */
	cases[9].open_kind = true;
	cases[10].index = 0;
	for (size_t i = 0; i < n; i++)
		if (parse_interface(&cases[i], &link) != -EBADMSG)
			fail_msg("case %zu", i);
	/* A later kernel may say more of the timing. */
	cases[0].timing_size = sizeof(struct can_bittiming) + 8;
	assert_int_equal(parse_interface(&cases[0], &link), 1);
	assert_int_equal(link.bitrate, 500000);
}

/* A datagram that ends early, and one that also says so in its header. */
static void what_is_cut_off_is_refused(void **state)
{
	struct datagram d = {.n = 0};
	struct can_netlink link;
	int whole = 0;

	put_link(&d, &can0, SEQUENCE, PORT);
	for (size_t n = 1; n < d.n; n++)
		assert_int_equal(parse(d.bytes, n, &link), -EBADMSG);
	for (uint32_t n = 0; n < d.n; n++) {
		memcpy(d.bytes, &n, sizeof(n));
		whole += parse(d.bytes, n, &link) == 1;
	}
	/* Any other length in its header. */
	for (int shift = 10; shift < 32; shift++) {
		uint32_t length = 1u << shift;

		memcpy(d.bytes, &length, sizeof(length));
		assert_int_equal(parse(d.bytes, d.n, &link), -EBADMSG);
	}
	/* Only where an attribute after the name would begin: behind the name or one of the
	 * three bytes that fill it up, behind IFLA_STATS and behind IFLA_LINKINFO. */
	assert_int_equal(whole, 6);
}

static void whatever_comes_is_read_within_it(void **state)
{
	struct datagram whole = {.n = 0};
	uint32_t seed = 1;

	put_link(&whole, &can0, SEQUENCE, PORT);
	for (int i = 0; i < 50000; i++) {
		struct datagram d = whole;
		struct can_netlink link;
		int rc;

		for (int k = 0; k < 3; k++) {
			seed = seed * 1664525 + 1013904223;
			d.bytes[(seed >> 16) % d.n] = (unsigned char)(seed >> 8);
		}
		rc = parse(d.bytes, d.n, &link);
		assert_true(rc >= -4095 && rc <= 1);
		if (rc != 1)
			continue;
		assert_true(strnlen(link.name, IF_NAMESIZE) < IF_NAMESIZE);
		assert_true(strnlen(link.kind, sizeof(link.kind)) < sizeof(link.kind));
		assert_true(link.state == -EOPNOTSUPP ||
			    (link.state >= 0 && link.state < CAN_STATE_MAX));
	}
}

static void refusals_are_the_kernels(void **state)
{
	static const struct {
		int code, rc;
	} cases[] = {
		{-ENODEV, -ENODEV}, {-EPERM, -EPERM},  {0, -EBADMSG},
		{19, -EBADMSG},	    {-4096, -EBADMSG}, {INT32_MIN, -EBADMSG},
	};
	struct can_netlink link;
	struct datagram d;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		d.n = 0;
		put_error(&d, cases[i].code, SEQUENCE, PORT);
		assert_int_equal(parse(d.bytes, d.n, &link), cases[i].rc);
	}
	/* Too short for one. */
	d.n = 0;
	message_end(&d, message_begin(&d, NLMSG_ERROR, SEQUENCE, PORT));
	assert_int_equal(parse(d.bytes, d.n, &link), -EBADMSG);
}

static void what_is_for_others_is_passed_over(void **state)
{
	struct datagram d = {.n = 0};
	struct can_netlink link;

	assert_int_equal(parse(d.bytes, 0, &link), 0);
	put_error(&d, -ENODEV, SEQUENCE + 1, PORT);
	put_error(&d, -ENODEV, SEQUENCE, PORT + 1);
	put_error(&d, -ENODEV, 0, 0);
	message_end(&d, message_begin(&d, NLMSG_NOOP, SEQUENCE, PORT));
	assert_int_equal(parse(d.bytes, d.n, &link), 0);
	put_link(&d, &can0, SEQUENCE, PORT);
	assert_int_equal(parse(d.bytes, d.n, &link), 1);
	assert_int_equal(link.bitrate, 500000);
}

/* The kernel at the other end of the socket, where fake.on. */
static struct {
	bool on;
	int open_error, send_error;
	int limit_s;
	struct datagram asked;
	struct datagram answers[4];
	int errors[4]; /* in place of an answer */
	int n, next;
	bool endless; /* the last one again and again */
	int64_t now_ns;
} fake;

struct mnl_socket *__real_mnl_socket_open2(int bus, int flags);
ssize_t __real_mnl_socket_sendto(const struct mnl_socket *socket, const void *bytes,
				 size_t n);
ssize_t __real_mnl_socket_recvfrom(const struct mnl_socket *socket, void *bytes,
				   size_t size);
unsigned int __real_mnl_socket_get_portid(const struct mnl_socket *socket);
int __real_setsockopt(int fd, int level, int name, const void *value, socklen_t size);
int __real_clock_gettime(clockid_t clock, struct timespec *t);

struct mnl_socket *__wrap_mnl_socket_open2(int bus, int flags)
{
	assert_int_equal(bus, NETLINK_ROUTE);
	assert_int_equal(flags, SOCK_CLOEXEC);
	errno = fake.open_error;
	return fake.open_error ? NULL : __real_mnl_socket_open2(bus, flags);
}

ssize_t __wrap_mnl_socket_sendto(const struct mnl_socket *socket, const void *bytes,
				 size_t n)
{
	if (!fake.on)
		return __real_mnl_socket_sendto(socket, bytes, n);
	fake.asked.n = 0;
	append(&fake.asked, bytes, n);
	errno = fake.send_error;
	return fake.send_error ? -1 : (ssize_t)n;
}

ssize_t __wrap_mnl_socket_recvfrom(const struct mnl_socket *socket, void *bytes,
				   size_t size)
{
	int i = fake.next;

	if (!fake.on)
		return __real_mnl_socket_recvfrom(socket, bytes, size);
	/* Without a time limit this would wait for ever. */
	assert_true(fake.limit_s > 0 && fake.limit_s <= 2);
	fake.now_ns += S / 10;
	if (i == fake.n) {
		fake.now_ns += fake.limit_s * S;
		errno = EAGAIN;
		return -1;
	}
	if (!fake.endless || i + 1 < fake.n)
		fake.next++;
	errno = fake.errors[i];
	if (fake.errors[i])
		return -1;
	assert_true(fake.answers[i].n <= size);
	memcpy(bytes, fake.answers[i].bytes, fake.answers[i].n);
	return (ssize_t)fake.answers[i].n;
}

unsigned int __wrap_mnl_socket_get_portid(const struct mnl_socket *socket)
{
	return fake.on ? PORT : __real_mnl_socket_get_portid(socket);
}

int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size)
{
	if (level == SOL_SOCKET && name == SO_RCVTIMEO)
		fake.limit_s = (int)((const struct timeval *)value)->tv_sec;
	return __real_setsockopt(fd, level, name, value, size);
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
	if (!fake.on)
		return __real_clock_gettime(clock, t);
	*t = (struct timespec){fake.now_ns / S, fake.now_ns % S};
	return 0;
}

static int fake_begin(void **state)
{
	memset(&fake, 0, sizeof(fake));
	fake.on = true;
	fake.now_ns = 1000 * S;
	return 0;
}

static int fake_end(void **state)
{
	fake.on = false;
	fake.open_error = 0;
	return 0;
}

static void the_question_is_by_name(void **state)
{
	struct can_netlink link;
	struct nlmsghdr header;
	struct nlattr attr;

	put_link(&fake.answers[0], &can0, SEQUENCE, PORT);
	fake.n = 1;
	assert_int_equal(can_netlink_query("can0", &link), 0);
	assert_string_equal(link.name, "can0");
	assert_int_equal(link.bitrate, 500000);
	memcpy(&header, fake.asked.bytes, sizeof(header));
	assert_int_equal(header.nlmsg_type, RTM_GETLINK);
	assert_int_equal(header.nlmsg_flags, NLM_F_REQUEST);
	assert_int_equal(header.nlmsg_seq, SEQUENCE);
	assert_int_equal(header.nlmsg_len, fake.asked.n);
	memcpy(&attr, fake.asked.bytes + sizeof(header) + sizeof(struct ifinfomsg),
	       sizeof(attr));
	assert_int_equal(attr.nla_type, IFLA_IFNAME);
	assert_int_equal(attr.nla_len, NLA_HDRLEN + sizeof("can0"));
	assert_string_equal(fake.asked.bytes + fake.asked.n - 8, "can0");
}

static void what_is_no_name_is_not_asked(void **state)
{
	struct can_netlink link;

	assert_int_equal(can_netlink_query("", &link), -ENODEV);
	assert_int_equal(can_netlink_query("sixteen-or-more-", &link), -ENODEV);
	assert_int_equal(fake.asked.n, 0);
	assert_int_equal(can_netlink_query("fifteen-at-most", &link), -ETIMEDOUT);
	assert_true(fake.asked.n > 0);
}

static void what_fails_is_said(void **state)
{
	struct can_netlink link;
	static const struct {
		int open_error, send_error, receive_error, rc;
	} cases[] = {
		{EMFILE, 0, 0, -EMFILE},    {0, ENOBUFS, 0, -ENOBUFS},
		{0, 0, ENOSPC, -EBADMSG},   {0, 0, ENOBUFS, -ENOBUFS},
		{0, 0, EAGAIN, -ETIMEDOUT},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		fake_begin(NULL);
		fake.open_error = cases[i].open_error;
		fake.send_error = cases[i].send_error;
		fake.errors[0] = cases[i].receive_error;
		fake.n = 1;
		assert_int_equal(can_netlink_query("can0", &link), cases[i].rc);
	}
	fake_begin(NULL);
	put_error(&fake.answers[0], -ENODEV, SEQUENCE, PORT);
	fake.n = 1;
	assert_int_equal(can_netlink_query("can0", &link), -ENODEV);
}

/* No answer, endless signals, or endless messages for others. */
static void every_wait_has_a_limit(void **state)
{
	struct can_netlink link;

	for (int i = 0; i < 3; i++) {
		fake_begin(NULL);
		fake.n = i > 0;
		fake.endless = true;
		if (i == 1)
			fake.errors[0] = EINTR;
		else if (i == 2)
			put_link(&fake.answers[0], &can0, SEQUENCE, PORT + 1);
		assert_int_equal(can_netlink_query("can0", &link), -ETIMEDOUT);
		assert_true(fake.now_ns <= 1000 * S + 2 * S);
	}
	/* A late answer still counts. */
	fake_begin(NULL);
	fake.errors[0] = EINTR;
	put_error(&fake.answers[1], -ENODEV, SEQUENCE + 1, PORT);
	put_link(&fake.answers[2], &can0, SEQUENCE, PORT);
	fake.n = 3;
	assert_int_equal(can_netlink_query("can0", &link), 0);
	assert_int_equal(link.index, 5);
}

static void the_kernel_tells_of_lo(void **state)
{
	struct can_netlink link;

	if (!if_nametoindex("lo"))
		skip();
	assert_int_equal(can_netlink_query("lo", &link), 0);
	assert_string_equal(link.name, "lo");
	assert_int_equal(link.index, if_nametoindex("lo"));
	assert_false(link.is_can);
	assert_int_equal(can_netlink_query("no-such-one", &link), -ENODEV);
}

#define ON_FAKE(test) cmocka_unit_test_setup_teardown(test, fake_begin, fake_end)

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_controller_is_told),
		cmocka_unit_test(what_is_not_known_is_not_made_up),
		cmocka_unit_test(other_kinds_tell_no_rate),
		cmocka_unit_test(what_has_not_its_size_is_refused),
		cmocka_unit_test(what_is_cut_off_is_refused),
		cmocka_unit_test(whatever_comes_is_read_within_it),
		cmocka_unit_test(refusals_are_the_kernels),
		cmocka_unit_test(what_is_for_others_is_passed_over),
		ON_FAKE(the_question_is_by_name),
		ON_FAKE(what_is_no_name_is_not_asked),
		ON_FAKE(what_fails_is_said),
		ON_FAKE(every_wait_has_a_limit),
		cmocka_unit_test(the_kernel_tells_of_lo),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
