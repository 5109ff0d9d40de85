// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/socketcan_netlink.c on an answer as the kernel gives it, with bytes of it
 * changed, and on the kernel's own answer for lo. tests/vm/guest/can_bus.sh queries a real controller.
 */
#include "../unit.h"
#include <net/if.h>
#include <net/if_arp.h>
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
#define COUNT(table) (sizeof(table) / sizeof(*(table)))

/* The kernel's answer about can0 on a little-endian machine; cases change some bytes of it. */
static const char can0[] =
	"b4000000 1000 0000 01000000 67120000" /* RTM_NEWLINK, SEQUENCE, PORT */
	"0000 1801 05000000 41000000 00000000" /* ARPHRD_CAN, index 5, up and running */
	"0900 0300 63616e3000 000000"	       /* IFLA_IFNAME can0 */
	"0800 0700 00000000"		       /* IFLA_STATS, cut off */
	"7800 1200"			       /* IFLA_LINKINFO */
	"2400 0100 63616e00 00000000 00000000 00000000" /* IFLA_INFO_KIND can */
	"00000000 00000000 00000000 00000000"		/* … which may be longer */
	"5000 0280"					/* IFLA_INFO_DATA */
	"2400 0100 20a10700 00000000 00000000 00000000" /* BITTIMING: 500000 */
	"00000000 00000000 00000000 00000000"
	"0400 2a00 0400 2a00"	       /* empty attributes of a later kernel */
	"0800 0300 00366e01"	       /* IFLA_CAN_CLOCK */
	"0800 0400 02000000 0400 2a00" /* IFLA_CAN_STATE, and an empty one */
	"0800 0600 64000000 0400 2a00" /* IFLA_CAN_RESTART_MS 100, likewise */
	"0800 1b00 00000000";	       /* IFLA_GROUP */

/* Where these are in it. */
enum {
	LENGTH = 0,
	KIND_OF_MESSAGE = 4,
	SEQUENCE_AT = 8,
	PORT_AT = 12,
	TYPE = 18,
	INDEX = 20,
	FLAGS = 24,
	LINKINFO = 52,
	KIND = 56,
	DATA = 92,
	TIMING = 96,
	BITRATE = 100,
	STATE = 148,
	STATE_VALUE = 152,
	END = 172,
};

static const char refusal[] = "24000000 0200 0000 01000000 67120000 edffffff" /* ENODEV */
			      "00000000 00000000 00000000 00000000";

struct message {
	_Alignas(struct nlmsghdr) unsigned char bytes[256];
	size_t n;
};

static struct message from_hex(const char *hex)
{
	struct message m = {.n = 0};
	int taken;

	for (; sscanf(hex, " %2hhx%n", &m.bytes[m.n], &taken) == 1; hex += taken)
		m.n++;
	return m;
}

static void put16(struct message *m, size_t at, uint16_t value)
{
	memcpy(m->bytes + at, &value, sizeof(value));
}

static void put32(struct message *m, size_t at, uint32_t value)
{
	memcpy(m->bytes + at, &value, sizeof(value));
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

static int parse_message(const struct message *m, struct can_netlink *link)
{
	return parse(m->bytes, m->n, link);
}

TEST(a_controller_is_told)
{
	const struct message usual = from_hex(can0);
	struct message m = usual;
	struct can_netlink link;

	for (int n = 0; n < 2; n++) {
		assert_int_equal(parse_message(&m, &link), 1);
		assert_string_equal(link.name, "can0");
		assert_string_equal(link.kind, "can");
		assert_int_equal(link.index, 5);
		assert_true(link.is_can && link.is_up);
		assert_int_equal(link.bitrate, 500000);
		assert_int_equal(link.state, CAN_STATE_ERROR_PASSIVE);
		/* In any order: the data before their kind. */
		memcpy(m.bytes + KIND, usual.bytes + DATA, END - DATA);
		memcpy(m.bytes + KIND + END - DATA, usual.bytes + KIND, DATA - KIND);
	}
}

TEST(what_is_not_known_is_not_made_up)
{
	struct message m = from_hex(can0);
	struct can_netlink link;

	put32(&m, BITRATE, UINT32_MAX);
	put32(&m, STATE_VALUE, CAN_STATE_MAX);
	put32(&m, FLAGS, 0);
	assert_int_equal(parse_message(&m, &link), 1);
	assert_int_equal(link.bitrate, 0);
	assert_int_equal(link.state, -EOPNOTSUPP);
	assert_false(link.is_up);
	m = from_hex(can0);
	put16(&m, DATA + 2, 0x802a); /* no data */
	assert_int_equal(parse_message(&m, &link), 1);
	assert_int_equal(link.bitrate, 0);
	assert_int_equal(link.state, -EOPNOTSUPP);
}

/* Their data is not a controller's, though the numbers of its attributes are the same. */
TEST(other_kinds_tell_no_rate)
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

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct message m = from_hex(can0);
		struct can_netlink link;

		put16(&m, TYPE, cases[i].type);
		put16(&m, STATE, 5); /* of another size */
		if (cases[i].kind)
			strcpy((char *)m.bytes + KIND + 4, cases[i].kind);
		else
			put16(&m, LINKINFO + 2, 0x2a);
		assert_int_equal(parse_message(&m, &link), 1);
		assert_string_equal(link.kind, cases[i].is);
		assert_int_equal(link.is_can, cases[i].type == ARPHRD_CAN);
		assert_int_equal(link.bitrate, 0);
		assert_int_equal(link.state, -EOPNOTSUPP);
	}
}

TEST(what_has_not_its_size_is_refused)
{
	static const struct {
		size_t at;
		uint16_t value;
		int rc;
	} cases[] = {
		{TIMING, 4 + sizeof(struct can_bittiming) - 1, -EBADMSG},
		{STATE, 4 + 3, -EBADMSG},
		{STATE, 4 + 8, -EBADMSG},     /* with the empty one behind it */
		{DATA, 3, -EBADMSG},	      /* less than its own header */
		{DATA, 999, -EBADMSG},	      /* more than there is */
		{DATA, 43, -EBADMSG},	      /* ends within an attribute */
		{DATA - 2, 0x2020, -EBADMSG}, /* the kind does not end */
		{INDEX, 0, -EBADMSG},
		/* A later kernel may say more of the timing. */
		{TIMING, 4 + sizeof(struct can_bittiming) + 8, 1},
	};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct message m = from_hex(can0);
		struct can_netlink link;

		put16(&m, cases[i].at, cases[i].value);
		if (parse_message(&m, &link) != cases[i].rc)
			fail_msg("case %zu", i);
	}
}

/* A datagram that ends early, and one that also says so in its header. */
TEST(what_is_cut_off_is_refused)
{
	struct message m = from_hex(can0);
	struct can_netlink link;
	int whole = 0;

	for (size_t n = 1; n < m.n; n++)
		assert_int_equal(parse(m.bytes, n, &link), -EBADMSG);
	for (uint32_t n = 0; n < m.n; n++) {
		put32(&m, LENGTH, n);
		whole += parse(m.bytes, n, &link) == 1;
	}
	/* Any other length in its header. */
	for (int shift = 10; shift < 32; shift++) {
		put32(&m, LENGTH, 1u << shift);
		assert_int_equal(parse_message(&m, &link), -EBADMSG);
	}
	/* Only where an attribute after the name would begin: behind the name or one of the
	 * three bytes that fill it up, behind IFLA_STATS and behind IFLA_LINKINFO. */
	assert_int_equal(whole, 6);
}

TEST(whatever_comes_is_read_within_it)
{
	const struct message whole = from_hex(can0);
	uint32_t seed = 1;

	for (int i = 0; i < 50000; i++) {
		struct message m = whole;
		struct can_netlink link;
		int rc;

		for (int k = 0; k < 3; k++) {
			seed = seed * 1664525 + 1013904223;
			m.bytes[(seed >> 16) % m.n] = (unsigned char)(seed >> 8);
		}
		rc = parse_message(&m, &link);
		assert_true(rc >= -4095 && rc <= 1);
		if (rc != 1)
			continue;
		assert_true(strnlen(link.name, IF_NAMESIZE) < IF_NAMESIZE);
		assert_true(strnlen(link.kind, sizeof(link.kind)) < sizeof(link.kind));
		assert_true(link.state == -EOPNOTSUPP ||
			    (link.state >= 0 && link.state < CAN_STATE_MAX));
	}
}

TEST(refusals_are_the_kernels)
{
	static const struct {
		int code, rc;
	} cases[] = {
		{-ENODEV, -ENODEV}, {-EPERM, -EPERM},  {0, -EBADMSG},
		{19, -EBADMSG},	    {-4096, -EBADMSG}, {INT32_MIN, -EBADMSG},
	};
	struct message m = from_hex(refusal);
	struct can_netlink link;

	for (size_t i = 0; i < COUNT(cases); i++) {
		put32(&m, sizeof(struct nlmsghdr), (uint32_t)cases[i].code);
		assert_int_equal(parse_message(&m, &link), cases[i].rc);
	}
	/* Too short for one. */
	m.n = sizeof(struct nlmsghdr);
	put32(&m, LENGTH, (uint32_t)m.n);
	assert_int_equal(parse_message(&m, &link), -EBADMSG);
}

TEST(what_is_for_others_is_passed_over)
{
	static const struct {
		size_t at;
		uint32_t value;
	} cases[] = {{SEQUENCE_AT, SEQUENCE + 1},
		     {PORT_AT, PORT + 1},
		     {KIND_OF_MESSAGE, NLMSG_NOOP}};
	struct message all = {.n = 0}, m;
	struct can_netlink link;

	assert_int_equal(parse_message(&all, &link), 0);
	for (size_t i = 0; i < COUNT(cases); i++) {
		m = from_hex(refusal);
		put32(&m, cases[i].at, cases[i].value);
		memcpy(all.bytes, m.bytes, m.n);
		all.n = m.n;
		assert_int_equal(parse_message(&all, &link), 0);
		m = from_hex(can0);
		memcpy(all.bytes + all.n, m.bytes, m.n);
		all.n += m.n;
		assert_int_equal(parse_message(&all, &link), 1);
		assert_int_equal(link.bitrate, 500000);
	}
}

/* The kernel at the other end of the socket, where fake.on. */
static struct {
	bool on;
	int open_error, send_error;
	int limit_s;
	struct message asked;
	struct message answers[4];
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
	memcpy(fake.asked.bytes, bytes, n);
	fake.asked.n = n;
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

TEST(the_question_is_by_name, fake_begin, fake_end)
{
	struct can_netlink link;
	struct nlmsghdr header;
	struct nlattr attr;

	fake.answers[0] = from_hex(can0);
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
	assert_memory_equal(fake.asked.bytes + fake.asked.n - 8, "can0", sizeof("can0"));
}

TEST(what_is_no_name_is_not_asked, fake_begin, fake_end)
{
	struct can_netlink link;

	assert_int_equal(can_netlink_query("", &link), -ENODEV);
	assert_int_equal(can_netlink_query("sixteen-or-more-", &link), -ENODEV);
	assert_int_equal(fake.asked.n, 0);
	assert_int_equal(can_netlink_query("fifteen-at-most", &link), -ETIMEDOUT);
	assert_true(fake.asked.n > 0);
}

TEST(what_fails_is_said, fake_begin, fake_end)
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
	fake.answers[0] = from_hex(refusal);
	fake.n = 1;
	assert_int_equal(can_netlink_query("can0", &link), -ENODEV);
}

/* No answer, endless signals, or endless messages for others. */
TEST(every_wait_has_a_limit, fake_begin, fake_end)
{
	struct can_netlink link;

	for (int i = 0; i < 3; i++) {
		fake_begin(NULL);
		fake.n = i > 0;
		fake.endless = true;
		fake.errors[0] = i == 1 ? EINTR : 0;
		fake.answers[0] = from_hex(can0);
		put32(&fake.answers[0], PORT_AT, PORT + 1);
		assert_int_equal(can_netlink_query("can0", &link), -ETIMEDOUT);
		assert_true(fake.now_ns <= 1000 * S + 2 * S);
	}
	/* A late answer still counts. */
	fake_begin(NULL);
	fake.errors[0] = EINTR;
	fake.answers[1] = from_hex(refusal);
	put32(&fake.answers[1], SEQUENCE_AT, SEQUENCE + 1);
	fake.answers[2] = from_hex(can0);
	fake.n = 3;
	assert_int_equal(can_netlink_query("can0", &link), 0);
	assert_int_equal(link.index, 5);
}

TEST(the_kernel_tells_of_lo)
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
