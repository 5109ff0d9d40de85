// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan.c on a pseudo terminal: the test plays the adapter at the other end.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/bus/can_bus.h"

#define MS 1000000

/* write() takes at most so many bytes at once (-1: all), after so many signals, or fails. */
static ssize_t write_most = -1;
static int write_interrupts, write_error;
/* Then it takes so many bytes in all (-1: any number). */
static ssize_t write_left = -1;

ssize_t __real_write(int fd, const void *bytes, size_t n);

ssize_t __wrap_write(int fd, const void *bytes, size_t n)
{
	ssize_t done;

	if (write_interrupts-- > 0) {
		errno = EINTR;
		return -1;
	}
	if (write_error) {
		errno = write_error;
		return -1;
	}
	if (write_most >= 0 && n > (size_t)write_most)
		n = (size_t)write_most;
	if (write_left >= 0 && n > (size_t)write_left)
		n = (size_t)write_left;
	if (!n) {
		errno = EAGAIN;
		return -1;
	}
	done = __real_write(fd, bytes, n);
	if (write_left >= 0 && done > 0)
		write_left -= done;
	return done;
}

static void write_all(void)
{
	write_most = write_left = -1;
	write_interrupts = write_error = 0;
}

struct adapter {
	int fd;
	char path[64];
	struct can_bus *bus;
};

static void adapter_new(struct adapter *a)
{
	a->fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
	assert_true(a->fd >= 0 && !grantpt(a->fd) && !unlockpt(a->fd));
	assert_int_equal(ptsname_r(a->fd, a->path, sizeof(a->path)), 0);
	a->bus = NULL;
	write_all();
}

static int open_device(struct adapter *a, const char *device, uint32_t bitrate,
		       struct incise_error *err)
{
	const struct can_bus_request request = {
		.where = "rig.conf:1: stepper", .device = device, .bitrate = bitrate};

	return can_transport_slcan.open(&a->bus, &request, err);
}

static int adapter_open(struct adapter *a, uint32_t bitrate, struct incise_error *err)
{
	return open_device(a, a->path, bitrate, err);
}

/* Returns the bytes that the adapter received, @least of them; CR is shown as a dot. */
static const char *received(struct adapter *a, size_t least)
{
	static char text[4096];
	struct pollfd poll_fd = {.fd = a->fd, .events = POLLIN};
	size_t n = 0;

	/* A kernel worker passes the bytes of a pty on: wait for those that are expected. */
	while (n < sizeof(text) - 1 && poll(&poll_fd, 1, n < least ? 10000 : 20) == 1) {
		ssize_t got = read(a->fd, text + n, sizeof(text) - 1 - n);

		if (got <= 0)
			break;
		n += (size_t)got;
	}
	text[n] = 0;
	for (size_t i = 0; i < n; i++)
		if (text[i] == '\r')
			text[i] = '.';
	return text;
}

/* Likewise without queries, which follow a frame after 100 ms of any machine's stall. */
static const char *frames_received(struct adapter *a, size_t least)
{
	static char frames[4096];
	const char *text = received(a, least);
	size_t n = 0;

	for (; *text; text++)
		if (!strncmp(text, "F.", 2))
			text++;
		else
			frames[n++] = *text;
	frames[n] = 0;
	return frames;
}

static void send_bytes(struct adapter *a, const char *bytes, size_t n)
{
	assert_int_equal(__real_write(a->fd, bytes, n), n);
}

#define SEND(a, text) send_bytes(a, text, sizeof(text) - 1)

/* The next frame or error frame; 0: none within 50 ms. */
static int next(struct adapter *a, struct can_frame *frame)
{
	int64_t end = a->bus->ops->now(a->bus) + 50 * MS, t_ns;
	int rc;

	do {
		rc = a->bus->ops->receive(a->bus, frame, &t_ns);
		if (rc)
			break;
		rc = a->bus->ops->wait(a->bus, end);
		assert_true(rc == 0 || rc == -ENODEV);
	} while (!rc && a->bus->ops->now(a->bus) < end);
	if (rc == 1)
		assert_true(t_ns <= a->bus->ops->now(a->bus) && t_ns > end - 1000 * MS);
	return rc;
}

static int setup(void **state)
{
	static struct adapter a;
	struct incise_error err = {0};

	adapter_new(&a);
	if (adapter_open(&a, 500000, &err))
		fail_msg("%s", err.text);
	assert_string_equal(received(&a, strlen(".C.S6.O.")), ".C.S6.O.");
	*state = &a;
	return 0;
}

static int teardown(void **state)
{
	struct adapter *a = *state;

	write_all();
	if (a->bus)
		a->bus->ops->close(a->bus);
	if (a->fd >= 0)
		close(a->fd);
	return 0;
}

static void the_adapter_goes_on_the_bus_and_off(void **state)
{
	static const struct {
		uint32_t bitrate, is;
		const char *said;
	} cases[] = {
		{10000, 10000, ".C.S0.O."},	{20000, 20000, ".C.S1.O."},
		{50000, 50000, ".C.S2.O."},	{100000, 100000, ".C.S3.O."},
		{125000, 125000, ".C.S4.O."},	{250000, 250000, ".C.S5.O."},
		{500000, 500000, ".C.S6.O."},	{800000, 800000, ".C.S7.O."},
		{1000000, 1000000, ".C.S8.O."}, {0, 1000000, ".C.S8.O."},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct termios t;
		struct adapter a;

		adapter_new(&a);
		assert_int_equal(adapter_open(&a, cases[i].bitrate, &err), 0);
		assert_string_equal(received(&a, strlen(cases[i].said)), cases[i].said);
		assert_int_equal(a.bus->bitrate, cases[i].is);
		assert_string_equal(a.bus->name, a.path);
		assert_int_equal(a.bus->ops->state(a.bus), -EOPNOTSUPP);
		assert_int_equal(tcgetattr(a.fd, &t), 0);
		assert_int_equal(t.c_lflag & (ICANON | ECHO | ISIG), 0);
		assert_int_equal(t.c_iflag & (IXON | IXOFF | ICRNL), 0);
		assert_int_equal(t.c_oflag & OPOST, 0);
		a.bus->ops->close(a.bus);
		assert_string_equal(received(&a, strlen("C.")), "C.");
		close(a.fd);
	}
}

static void a_rate_that_none_has_is_refused(void **state)
{
	struct incise_error err = {0};
	struct adapter a;

	adapter_new(&a);
	assert_int_equal(adapter_open(&a, 83333, &err), -EINVAL);
	assert_non_null(
		strstr(err.text, "rig.conf:1: stepper: no adapter supports 83333 bit/s"));
	close(a.fd);
}

static void the_rate_may_follow_the_tty(void **state)
{
	static const struct {
		const char *behind;
		uint32_t bitrate;
		int rc;
		const char *said; /* received by the adapter; or part of the message */
	} cases[] = {
		{"@500000", 0, 0, ".C.S6.O."},
		{"@500000", 500000, 0, ".C.S6.O."},
		{"@1000000", 0, 0, ".C.S8.O."},
		{"@10000", 0, 0, ".C.S0.O."},
		{"@500000", 250000, -EINVAL,
		 "has 500000 bit/s after its @, but bitrate is 250000"},
		{"@83333", 0, -EINVAL, "no adapter supports 83333 bit/s"},
		{"@0", 0, -EINVAL, "no adapter supports 0 bit/s"},
		{"@500k", 0, -EINVAL, "no adapter supports 500k bit/s"},
		{"@500000 ", 0, -EINVAL, "no adapter supports 500000  bit/s"},
		{"@4295467296", 0, -EINVAL, "no adapter supports 4295467296 bit/s"},
		{"@99999999999999999999", 0, -EINVAL,
		 "no adapter supports 99999999999999999999 bit/s"},
		{"@", 0, -ENODEV, "@; plug in the adapter"},
		{"@-500000", 0, -ENODEV, "@-500000; plug in the adapter"},
		{"@500000@", 0, -ENODEV, "@500000@; plug in the adapter"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct adapter a;
		char device[100];
		int rc;

		adapter_new(&a);
		snprintf(device, sizeof(device), "%s%s", a.path, cases[i].behind);
		rc = open_device(&a, device, cases[i].bitrate, &err);
		if (rc != cases[i].rc || (rc && !strstr(err.text, cases[i].said)))
			fail_msg("case %zu: %d: %s", i, rc, err.text);
		if (!rc) {
			assert_string_equal(received(&a, strlen(cases[i].said)),
					    cases[i].said);
			assert_int_equal(a.bus->bitrate, atoi(cases[i].behind + 1));
			assert_string_equal(a.bus->name, a.path);
			a.bus->ops->close(a.bus);
		}
		close(a.fd);
	}
}

static void a_path_may_have_an_at(void **state)
{
	char folder[] = "/tmp/incise-slcan-XXXXXX", path[64], device[80];
	struct incise_error err = {0};
	struct adapter a;

	adapter_new(&a);
	assert_non_null(mkdtemp(folder));
	snprintf(path, sizeof(path), "%s/usb@home", folder);
	snprintf(device, sizeof(device), "%s@250000", path);
	assert_int_equal(symlink(a.path, path), 0);
	assert_int_equal(open_device(&a, path, 0, &err), 0);
	assert_int_equal(a.bus->bitrate, 1000000);
	a.bus->ops->close(a.bus);
	assert_int_equal(open_device(&a, device, 0, &err), 0);
	assert_int_equal(a.bus->bitrate, 250000);
	a.bus->ops->close(a.bus);
	close(a.fd);
	unlink(path);
	rmdir(folder);
}

static void a_path_of_any_length_is_safe(void **state)
{
	static char device[10000];
	struct incise_error err = {0};
	struct adapter a = {.fd = -1};

	memset(device, 'x', sizeof(device) - 1);
	assert_int_equal(open_device(&a, device, 0, &err), -ENODEV);
	device[9000] = '@';
	memset(device + 9001, '5', 900);
	assert_int_equal(open_device(&a, device, 0, &err), -EINVAL);
}

static void one_program_at_a_time(void **state)
{
	struct adapter *a = *state, other = *a;
	struct incise_error err = {0};

	assert_int_equal(adapter_open(&other, 0, &err), -EBUSY);
	assert_ptr_equal(strstr(err.text,
				"rig.conf:1: stepper: another program has /dev/pts/"),
			 err.text);
	a->bus->ops->close(a->bus);
	a->bus = NULL;
	assert_int_equal(adapter_open(a, 0, &err), 0);
}

static void frames_go_both_ways(void **state)
{
	struct adapter *a = *state;
	struct can_frame out = {.can_id = 0x210,
				.can_dlc = 6,
				.data = {0x0f, 0, 0xff, 0xee, 0xdd, 0xcc}},
			 in;

	assert_int_equal(a->bus->ops->send(a->bus, &out), 0);
	assert_string_equal(frames_received(a, strlen("t21060F00FFEEDDCC.")),
			    "t21060F00FFEEDDCC.");
	out.can_dlc = 9;
	assert_int_equal(a->bus->ops->send(a->bus, &out), -EINVAL);
	/* This side ignores C, S and O, which python-can sends. */
	SEND(a, "C\rS8\rO\rz\rt190237AB12");
	assert_int_equal(next(a, &in), 0);
	SEND(a, "34\rT1FFFFFFF0\r");
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, 0x190);
	assert_int_equal(in.can_dlc, 2);
	assert_memory_equal(in.data, "\x37\xab", 2);
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, CAN_EFF_MASK | CAN_EFF_FLAG);
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->counts.sent, 1);
	assert_int_equal(a->bus->counts.received, 2);
	assert_int_equal(a->bus->counts.broken, 0);
	assert_int_equal(a->bus->counts.errors, 0);
}

static void junk_is_counted_and_skipped(void **state)
{
	static char junk[9000];
	struct adapter *a = *state;
	struct can_frame in;

	memset(junk, 'x', sizeof(junk));
	SEND(a, "\0\0t12\0\rt1231A\r");
	for (size_t at = 0; at < sizeof(junk); at += 3000) {
		send_bytes(a, junk + at, 3000);
		assert_int_equal(next(a, &in), 0);
	}
	SEND(a, "\rt1230\r");
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, 0x123);
	assert_int_equal(a->bus->counts.broken, 3);
}

static void filters_are_exact(void **state)
{
	struct adapter *a = *state;
	const canid_t mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
	const struct can_filter exact[] = {{0x190, mask}, {0x710, mask}};
	const struct can_filter other = {0x190 | CAN_INV_FILTER, mask};
	struct can_filter many[CAN_BUS_FILTERS + 1] = {{0}};
	static const char all[] = "t1900\rT000001900\rr1900\rt1910\rt7100\rt0000\r";
	struct can_frame in;
	int n = 0;

	assert_int_equal(a->bus->ops->filter(a->bus, exact, 2), 0);
	send_bytes(a, all, sizeof(all) - 1);
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, 0x190);
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, 0x710);
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->ops->filter(a->bus, &other, 1), 0);
	send_bytes(a, all, sizeof(all) - 1);
	while (next(a, &in)) {
		assert_int_not_equal(in.can_id, 0x190);
		n++;
	}
	assert_int_equal(n, 5);
	assert_int_equal(a->bus->ops->filter(a->bus, NULL, 0), 0);
	send_bytes(a, all, sizeof(all) - 1);
	for (n = 0; next(a, &in); n++)
		;
	assert_int_equal(n, 6);
	assert_int_equal(a->bus->ops->filter(a->bus, many, CAN_BUS_FILTERS + 1), -EINVAL);
}

/* Send until the adapter is queried for its status: 100 ms. */
static void until_queried(struct adapter *a)
{
	const struct can_frame sync = {.can_id = 0x080};
	int64_t query_ns;

	nanosleep(&(struct timespec){.tv_nsec = 101 * MS}, NULL);
	query_ns = a->bus->ops->now(a->bus);
	assert_int_equal(a->bus->ops->send(a->bus, &sync), 0);
	assert_string_equal(received(a, strlen("t0800.F.")), "t0800.F.");
	assert_int_equal(a->bus->ops->send(a->bus, &sync), 0);
	/* No further query, unless the machine stalled. */
	if (a->bus->ops->now(a->bus) - query_ns < 100 * MS)
		assert_string_equal(received(a, strlen("t0800.")), "t0800.");
	else
		assert_string_equal(frames_received(a, strlen("t0800.")), "t0800.");
}

static void status_becomes_error_frames(void **state)
{
	static const struct {
		const char *answer;
		int state;
		canid_t id; /* 0: no frame */
		uint8_t controller;
	} cases[] = {
		{"F00\r", CAN_STATE_ERROR_ACTIVE, 0, 0},
		{"F40\r", CAN_STATE_ERROR_ACTIVE, 0, 0},
		{"F04\r", CAN_STATE_ERROR_WARNING, CAN_ERR_CRTL,
		 CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING},
		{"F04\r", CAN_STATE_ERROR_WARNING, 0, 0},
		{"FA4\r", CAN_STATE_ERROR_PASSIVE, CAN_ERR_CRTL | CAN_ERR_BUSERROR,
		 CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE},
		{"F09\r", CAN_STATE_ERROR_ACTIVE, CAN_ERR_CRTL,
		 CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_OVERFLOW},
		{"F02\r", CAN_STATE_ERROR_ACTIVE, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW},
		{"sb000256\r", CAN_STATE_BUS_OFF, CAN_ERR_BUSOFF, 0},
		{"F02\r", CAN_STATE_BUS_OFF, 0, 0},
		{"sa000000\r", CAN_STATE_ERROR_ACTIVE, CAN_ERR_CRTL | CAN_ERR_RESTARTED,
		 CAN_ERR_CRTL_ACTIVE},
	};
	struct adapter *a = *state;
	struct can_frame in;
	uint64_t errors = 0;

	until_queried(a);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		send_bytes(a, cases[i].answer, strlen(cases[i].answer));
		assert_int_equal(next(a, &in), !!cases[i].id);
		assert_int_equal(a->bus->ops->state(a->bus), cases[i].state);
		if (!cases[i].id)
			continue;
		errors++;
		assert_int_equal(in.can_id, CAN_ERR_FLAG | cases[i].id);
		assert_int_equal(in.can_dlc, CAN_ERR_DLC);
		assert_int_equal(in.data[1], cases[i].controller);
	}
	assert_int_equal(a->bus->counts.errors, errors);
	assert_int_equal(a->bus->counts.overflow, 1);
	assert_int_equal(a->bus->counts.received, 0);
}

static void refusals_are_errors_but_for_the_start(void **state)
{
	struct adapter *a = *state;
	struct can_frame in;

	SEND(a, "\a\a\r\a");
	assert_int_equal(next(a, &in), 0);
	SEND(a, "\a\a");
	assert_int_equal(next(a, &in), 1);
	assert_int_equal(in.can_id, CAN_ERR_FLAG | CAN_ERR_CRTL);
	assert_int_equal(in.data[1], CAN_ERR_CRTL_TX_OVERFLOW);
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->counts.errors, 1);
}

static void an_adapter_without_the_query_is_left_alone(void **state)
{
	const struct can_frame sync = {.can_id = 0x080};
	struct adapter *a = *state;
	struct can_frame in;

	SEND(a, "\a\a\a\a");
	assert_int_equal(next(a, &in), 0);
	for (int i = 0; i < 3; i++) {
		until_queried(a);
		SEND(a, "\r\a");
		assert_int_equal(next(a, &in), 0);
	}
	nanosleep(&(struct timespec){.tv_nsec = 101 * MS}, NULL);
	assert_int_equal(a->bus->ops->send(a->bus, &sync), 0);
	assert_string_equal(received(a, strlen("t0800.")), "t0800.");
	assert_int_equal(a->bus->counts.errors, 0);
}

/* An adapter that does not read for a while: accepted frames arrive whole and in order. */
static void a_frame_is_sent_whole_or_not(void **state)
{
	struct adapter *a = *state;
	struct can_frame frame = {.can_id = 0x210, .can_dlc = 4};
	struct pollfd poll_fd = {.fd = a->fd, .events = POLLIN};
	uint32_t sent = 0, seen = 0;
	char line[64], byte;
	size_t n = 0;
	int rc;

	do {
		memcpy(frame.data, &sent, 4);
		rc = a->bus->ops->send(a->bus, &frame);
		sent += !rc;
	} while (!rc && sent < 100000);
	assert_int_equal(rc, -ENOBUFS);
	assert_int_equal(a->bus->ops->send(a->bus, &frame), -ENOBUFS);
	assert_int_equal(a->bus->counts.full, 2);
	assert_int_equal(a->bus->counts.sent, sent);
	while (poll(&poll_fd, 1, 100) == 1 && read(a->fd, &byte, 1) == 1) {
		if (byte != '\r') {
			line[n++] = byte;
			assert_true(n < sizeof(line));
			/* The last line may end here: now its rest goes out. */
			if (seen == sent - 1)
				a->bus->ops->wait(a->bus, 0);
			continue;
		}
		line[n] = 0;
		n = 0;
		if (!strcmp(line, "F"))
			continue;
		frame.data[0] = (uint8_t)seen;
		frame.data[1] = (uint8_t)(seen >> 8);
		frame.data[2] = (uint8_t)(seen >> 16);
		char expected[64];

		snprintf(expected, sizeof(expected), "t2104%02X%02X%02X00", frame.data[0],
			 frame.data[1], frame.data[2]);
		assert_string_equal(line, expected);
		seen++;
	}
	assert_int_equal(seen, sent);
	assert_int_equal(n, 0);
}

static void a_torn_line_is_finished_first(void **state)
{
	struct adapter *a = *state;
	const struct can_frame sync = {.can_id = 0x080}, other = {.can_id = 0x123};

	write_most = 0;
	assert_int_equal(a->bus->ops->send(a->bus, &sync), -ENOBUFS);
	write_most = 3;
	write_interrupts = 5;
	assert_int_equal(a->bus->ops->send(a->bus, &sync), 0);
	assert_int_equal(a->bus->ops->send(a->bus, &other), 0);
	assert_string_equal(frames_received(a, strlen("t0800.t1230.")), "t0800.t1230.");
	/* Two bytes went out, and then none do: the rest is kept, ahead of later frames. */
	write_left = 2;
	assert_int_equal(a->bus->ops->send(a->bus, &sync), 0);
	assert_int_equal(a->bus->ops->send(a->bus, &other), -ENOBUFS);
	assert_int_equal(a->bus->ops->wait(a->bus, 0), 0);
	assert_string_equal(frames_received(a, strlen("t0")), "t0");
	write_all();
	assert_int_equal(a->bus->ops->send(a->bus, &other), 0);
	assert_string_equal(frames_received(a, strlen("800.t1230.")), "800.t1230.");
	assert_int_equal(a->bus->counts.full, 2);
	assert_int_equal(a->bus->counts.sent, 4);
}

static void an_error_of_the_line_is_permanent(void **state)
{
	static const struct {
		int error, rc;
	} cases[] = {{EIO, -ENODEV}, {ENXIO, -ENODEV}, {ENODEV, -ENODEV}, {EPERM, -EIO}};
	const struct can_frame sync = {.can_id = 0x080};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct can_frame in;
		struct adapter a;
		int64_t t_ns;

		adapter_new(&a);
		assert_int_equal(adapter_open(&a, 0, NULL), 0);
		write_error = cases[i].error;
		assert_int_equal(a.bus->ops->send(a.bus, &sync), cases[i].rc);
		write_error = 0;
		assert_int_equal(a.bus->ops->send(a.bus, &sync), cases[i].rc);
		assert_int_equal(a.bus->ops->receive(a.bus, &in, &t_ns), cases[i].rc);
		a.bus->ops->close(a.bus);
		close(a.fd);
	}
}

/* No byte is translated, dropped or taken for flow control. */
static void bytes_arrive_unchanged(void **state)
{
	struct adapter *a = *state;
	struct can_frame in;
	char all[256];

	for (size_t i = 0; i < sizeof(all); i++)
		all[i] = (char)i;
	/* BEL and CR end broken lines; the line behind CR is too long. */
	send_bytes(a, all, sizeof(all));
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->counts.broken, 2);
	SEND(a, "\r");
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->counts.broken, 3);
	/* A byte that is dropped would leave a frame. */
	for (int byte = 0; byte < 256; byte++) {
		char line[] = {'t', '1', '2', '3', '0', (char)byte, '\r'};

		if (byte != '\r' && byte != '\a')
			send_bytes(a, line, sizeof(line));
	}
	assert_int_equal(next(a, &in), 0);
	assert_int_equal(a->bus->counts.broken, 3 + 254);
}

/* The speed that stty set stays; the default of a port that nobody set does not. */
static void the_speed_is_the_users(void **state)
{
	static const struct {
		speed_t set, is;
	} cases[] = {{B9600, B115200}, {B115200, B115200}, {B1000000, B1000000}};
	struct adapter *a = *state;
	struct incise_error err = {0};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct termios t;

		assert_int_equal(tcgetattr(a->fd, &t), 0);
		cfsetspeed(&t, cases[i].set);
		assert_int_equal(tcsetattr(a->fd, TCSANOW, &t), 0);
		a->bus->ops->close(a->bus);
		a->bus = NULL;
		assert_int_equal(adapter_open(a, 0, &err), 0);
		assert_int_equal(tcgetattr(a->fd, &t), 0);
		assert_int_equal(cfgetospeed(&t), cases[i].is);
		assert_int_equal(t.c_lflag & (ICANON | ECHO | ISIG), 0);
	}
}

static void a_path_that_is_no_tty_is_refused(void **state)
{
	char folder[] = "/tmp/incise-tty-XXXXXX", file[64], pipe[64];
	struct {
		const char *path;
		int code;
		const char *words;
	} cases[] = {
		{file, -EINVAL, "is not a serial port"},
		{pipe, -EINVAL, "is not a serial port"},
		{folder, -EINVAL, "is not a serial port"},
		{"/dev/null", -EINVAL, "is not a serial port"},
		{"", -ENODEV, "no such device"},
		{"/dev/ttyACM4711", -ENODEV, "plug in the adapter"},
	};
	int fd;

	assert_non_null(mkdtemp(folder));
	snprintf(file, sizeof(file), "%s/file", folder);
	snprintf(pipe, sizeof(pipe), "%s/pipe", folder);
	fd = open(file, O_CREAT | O_WRONLY, 0600);
	close(fd);
	assert_int_equal(mkfifo(pipe, 0600), 0);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct adapter a;

		assert_int_equal(open_device(&a, cases[i].path, 0, &err), cases[i].code);
		assert_int_equal(err.code, -cases[i].code);
		assert_non_null(strstr(err.text, cases[i].words));
	}
	unlink(file);
	unlink(pipe);
	rmdir(folder);
}

/* A late reader: frames sent before close() wait in the pty, and stay there. */
static void the_last_frames_arrive(void **state)
{
	const struct can_frame last = {.can_id = 0x000, .can_dlc = 2, .data = {0x80, 16}};
	struct adapter *a = *state;
	const char *text;
	size_t frames = 0;

	/* More than the 4096 bytes that the reader's side of a pty takes by itself. */
	for (int i = 0; i < 700; i++)
		assert_int_equal(a->bus->ops->send(a->bus,
						   &(struct can_frame){.can_id = 0x080}),
				 0);
	assert_int_equal(a->bus->ops->send(a->bus, &last), 0);
	a->bus->ops->close(a->bus);
	a->bus = NULL;
	do {
		text = frames_received(a, 1);
		for (const char *at = strchr(text, 't'); at; at = strchr(at + 1, 't'))
			frames++;
		if (strlen(text) >= 12 &&
		    !strcmp(text + strlen(text) - 12, "t00028010.C."))
			break;
	} while (*text);
	assert_true(*text);
	assert_int_equal(frames, 701);
}

/* And it ends too where the line is gone: see an_error_of_the_line_is_permanent(). */
static void closing_a_stuck_line_ends(void **state)
{
	struct adapter *a = *state;
	const struct can_frame sync = {.can_id = 0x080};

	write_most = 0;
	assert_int_equal(a->bus->ops->send(a->bus, &sync), -ENOBUFS);
	a->bus->ops->close(a->bus);
	a->bus = NULL;
}

static void an_adapter_that_is_unplugged_is_gone(void **state)
{
	struct adapter *a = *state;
	const struct can_frame sync = {.can_id = 0x080};
	struct can_frame in;

	SEND(a, "t1230\r");
	assert_int_equal(next(a, &in), 1);
	close(a->fd);
	a->fd = -1;
	assert_int_equal(next(a, &in), -ENODEV);
	assert_int_equal(next(a, &in), -ENODEV);
	assert_int_equal(a->bus->ops->send(a->bus, &sync), -ENODEV);
	assert_int_equal(a->bus->ops->wait(a->bus, INT64_MAX), -ENODEV);
}

static void sending_finds_a_lost_line(void **state)
{
	struct adapter *a = *state;
	const struct can_frame sync = {.can_id = 0x080};

	close(a->fd);
	a->fd = -1;
	assert_int_equal(a->bus->ops->send(a->bus, &sync), -ENODEV);
}

static void waiting_ends(void **state)
{
	struct adapter *a = *state;
	int64_t begin = a->bus->ops->now(a->bus);
	struct can_frame in;
	int64_t t_ns;

	/* A time in the past: at once, even without input. */
	assert_int_equal(a->bus->ops->wait(a->bus, 0), 0);
	assert_int_equal(a->bus->ops->wait(a->bus, INT64_MIN + begin), 0);
	assert_int_equal(a->bus->ops->wait(a->bus, begin + 5 * MS), 0);
	assert_true(a->bus->ops->now(a->bus) >= begin + 5 * MS);
	/* Two frames arrive at once: the second one needs no wait. */
	SEND(a, "t1230\rt1240\r");
	assert_int_equal(a->bus->ops->wait(a->bus, INT64_MAX), 0);
	assert_int_equal(a->bus->ops->receive(a->bus, &in, &t_ns), 1);
	assert_int_equal(a->bus->ops->wait(a->bus, INT64_MAX), 0);
}

#define WITH(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_adapter_goes_on_the_bus_and_off),
		cmocka_unit_test(a_rate_that_none_has_is_refused),
		cmocka_unit_test(the_rate_may_follow_the_tty),
		cmocka_unit_test(a_path_may_have_an_at),
		cmocka_unit_test(a_path_of_any_length_is_safe),
		WITH(one_program_at_a_time),
		WITH(frames_go_both_ways),
		WITH(junk_is_counted_and_skipped),
		WITH(filters_are_exact),
		WITH(status_becomes_error_frames),
		WITH(refusals_are_errors_but_for_the_start),
		WITH(an_adapter_without_the_query_is_left_alone),
		WITH(a_frame_is_sent_whole_or_not),
		WITH(a_torn_line_is_finished_first),
		cmocka_unit_test(an_error_of_the_line_is_permanent),
		WITH(bytes_arrive_unchanged),
		WITH(the_speed_is_the_users),
		cmocka_unit_test(a_path_that_is_no_tty_is_refused),
		WITH(the_last_frames_arrive),
		WITH(closing_a_stuck_line_ends),
		WITH(an_adapter_that_is_unplugged_is_gone),
		WITH(sending_finds_a_lost_line),
		WITH(waiting_ends),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
