// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan.c on a pseudo terminal: the test plays the adapter at the other end, on
 * a clock of its own. A pty passes its bytes on in a while: what is expected is waited for.
 */
#include "../unit.h"
#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/bus/can_bus.h"
#include "candump.h"

#define MS INT64_C(1000000)
#define S (1000 * MS)
#define COUNT(table) (sizeof(table) / sizeof(*(table)))

static int64_t clock_ns;

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
	*t = (struct timespec){clock_ns / S, clock_ns % S};
	return 0;
}

static bool quiet; /* nothing comes: the wait is over at once */

int __wrap_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout,
		 const sigset_t *mask)
{
	int rc = poll(fds, n, quiet ? 0 : 10000);

	if (!rc)
		clock_ns += timeout->tv_sec * S + timeout->tv_nsec;
	return rc;
}

/* write() takes at most so many bytes at once (-1: all), after so many signals, or fails. */
static ssize_t write_most = -1;
static int write_interrupts, write_error;
/* Then it takes so many bytes in all (-1: any number). */
static ssize_t write_left = -1;

ssize_t __real_write(int fd, const void *bytes, size_t n);

ssize_t __wrap_write(int fd, const void *bytes, size_t n)
{
	ssize_t done;

	errno = write_interrupts-- > 0 ? EINTR : write_error;
	if (errno)
		return -1;
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

/* The adapter's end, and the bus behind it. */
static int fd;
static char path[64];
static struct can_bus *bus;
static struct incise_error err;

static const struct can_frame sync_frame = {.can_id = 0x080},
			      other_frame = {.can_id = 0x123};

static void adapter_new(void)
{
	fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
	assert_true(fd >= 0 && !grantpt(fd) && !unlockpt(fd));
	assert_int_equal(ptsname_r(fd, path, sizeof(path)), 0);
	write_all();
	quiet = false;
	clock_ns = 1000 * S;
}

static int open_device(struct can_bus **opened, const char *device, uint32_t bitrate)
{
	const struct can_bus_request request = {
		.where = "rig.conf:1: stepper", .device = device, .bitrate = bitrate};

	err = (struct incise_error){0};
	return can_transport_slcan.open(opened, &request, &err);
}

static void close_bus(void)
{
	if (bus)
		bus->ops->close(bus);
	bus = NULL;
}

/* The adapter received these bytes; CR is shown as a dot. */
static void received(const char *expected)
{
	char text[200];
	size_t size = strlen(expected), n = 0;

	while (n < size) {
		struct pollfd waits = {.fd = fd, .events = POLLIN};
		ssize_t got =
			poll(&waits, 1, 10000) == 1 ? read(fd, text + n, size - n) : 0;

		assert_true(got > 0);
		n += (size_t)got;
	}
	for (size_t i = 0; i < n; i++)
		text[i] = text[i] == '\r' ? '.' : text[i];
	text[n] = '\0';
	assert_string_equal(text, expected);
}

static void say_bytes(const char *bytes, size_t n)
{
	assert_int_equal(__real_write(fd, bytes, n), n);
}

#define SAY(text) say_bytes(text, sizeof(text) - 1)

/* The next frame or error frame, or an error. */
static int next(struct can_frame *frame)
{
	int64_t t_ns = 0;
	int rc;

	while (!(rc = bus->ops->receive(bus, frame, &t_ns)))
		assert_int_equal(bus->ops->wait(bus, clock_ns + 10 * S), 0);
	if (rc == 1)
		assert_int_equal(t_ns, clock_ns);
	return rc;
}

static void expect(const char *text)
{
	struct can_frame expected = candump_read(text), frame = {0};

	assert_int_equal(next(&frame), 1);
	assert_memory_equal(&frame, &expected, sizeof(frame));
}

/* Earlier text was no frame: one that follows is the next. */
static void expect_nothing(void)
{
	uint64_t before = bus->counts.received;

	SAY("t7EE0\r");
	expect("7EE#");
	bus->counts.received = before;
}

static int setup(void **state)
{
	adapter_new();
	succeeds(!open_device(&bus, path, 500000));
	received(".C.S6.O.");
	return 0;
}

static int teardown(void **state)
{
	write_all();
	close_bus();
	return fd < 0 ? 0 : close(fd);
}

/* The rate is the request's, or follows the tty. */
TEST(the_adapter_goes_on_the_bus_and_off)
{
	static const struct {
		const char *behind;
		uint32_t bitrate;
		int rc;
		uint32_t is;
		const char *said; /* received by the adapter; or part of the message */
	} cases[] = {
		{"", 10000, 0, 10000, ".C.S0.O."},
		{"", 20000, 0, 20000, ".C.S1.O."},
		{"", 50000, 0, 50000, ".C.S2.O."},
		{"", 100000, 0, 100000, ".C.S3.O."},
		{"", 125000, 0, 125000, ".C.S4.O."},
		{"", 250000, 0, 250000, ".C.S5.O."},
		{"", 500000, 0, 500000, ".C.S6.O."},
		{"", 800000, 0, 800000, ".C.S7.O."},
		{"", 1000000, 0, 1000000, ".C.S8.O."},
		{"", 0, 0, 1000000, ".C.S8.O."},
		{"@500000", 0, 0, 500000, ".C.S6.O."},
		{"@500000", 500000, 0, 500000, ".C.S6.O."},
		{"@10000", 0, 0, 10000, ".C.S0.O."},
		{"", 83333, -EINVAL, 0, "83333"},
		{"@500000", 250000, -EINVAL, 0, "250000"},
		{"@83333", 0, -EINVAL, 0, "83333"},
		{"@0", 0, -EINVAL, 0, " 0 bit/s"},
		{"@500k", 0, -EINVAL, 0, "500k"},
		{"@500000 ", 0, -EINVAL, 0, "500000 "},
		{"@4295467296", 0, -EINVAL, 0, "4295467296"},
		{"@99999999999999999999", 0, -EINVAL, 0, "99999999999999999999"},
		{"@", 0, -ENODEV, 0, "@"},
		{"@-500000", 0, -ENODEV, 0, "@-500000"},
		{"@500000@", 0, -ENODEV, 0, "@500000@"},
	};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct termios t;
		char device[100];
		int rc;

		adapter_new();
		snprintf(device, sizeof(device), "%s%s", path, cases[i].behind);
		rc = open_device(&bus, device, cases[i].bitrate);
		if (rc != cases[i].rc || (rc && !strstr(err.text, cases[i].said)))
			fail_msg("case %zu: %d: %s", i, rc, err.text);
		if (!rc) {
			received(cases[i].said);
			assert_int_equal(bus->bitrate, cases[i].is);
			assert_string_equal(bus->name, path);
			assert_int_equal(bus->ops->state(bus), -EOPNOTSUPP);
			assert_int_equal(tcgetattr(fd, &t), 0);
			assert_int_equal(t.c_lflag & (ICANON | ECHO | ISIG), 0);
			assert_int_equal(t.c_iflag & (IXON | IXOFF | ICRNL), 0);
			assert_int_equal(t.c_oflag & OPOST, 0);
			close_bus();
			received("C.");
		}
		close(fd);
	}
}

TEST(a_path_is_a_serial_port_of_any_name)
{
	static char longest[10000];
	char folder[] = "/tmp/incise-slcan-XXXXXX", file[64], pipe[64], at[64], rate[80];
	const struct {
		const char *device;
		int code;
		uint32_t bitrate;
	} cases[] = {
		{at, 0, 1000000},      {rate, 0, 250000},
		{file, -EINVAL, 0},    {pipe, -EINVAL, 0},
		{folder, -EINVAL, 0},  {"/dev/null", -EINVAL, 0},
		{"", -ENODEV, 0},      {"/dev/ttyACM4711", -ENODEV, 0},
		{longest, -ENODEV, 0},
	};

	adapter_new();
	assert_non_null(mkdtemp(folder));
	snprintf(file, sizeof(file), "%s/file", folder);
	snprintf(pipe, sizeof(pipe), "%s/pipe", folder);
	snprintf(at, sizeof(at), "%s/usb@home", folder);
	snprintf(rate, sizeof(rate), "%s@250000", at);
	close(open(file, O_CREAT | O_WRONLY, 0600));
	assert_int_equal(mkfifo(pipe, 0600), 0);
	assert_int_equal(symlink(path, at), 0);
	memset(longest, 'x', sizeof(longest) - 1);
	for (size_t i = 0; i < COUNT(cases); i++) {
		assert_int_equal(open_device(&bus, cases[i].device, 0), cases[i].code);
		assert_int_equal(err.code, -cases[i].code);
		if (cases[i].code)
			continue;
		assert_int_equal(bus->bitrate, cases[i].bitrate);
		close_bus();
	}
	longest[9000] = '@';
	memset(longest + 9001, '5', 900);
	assert_int_equal(open_device(&bus, longest, 0), -EINVAL);
	close(fd);
	unlink(file);
	unlink(pipe);
	unlink(at);
	rmdir(folder);
}

TEST(one_program_at_a_time, setup, teardown)
{
	struct can_bus *second;

	assert_int_equal(open_device(&second, path, 0), -EBUSY);
	assert_non_null(strstr(err.text, path));
	close_bus();
	assert_int_equal(open_device(&bus, path, 0), 0);
}

TEST(frames_go_both_ways, setup, teardown)
{
	struct can_frame out = candump_read("210#0F00FFEEDDCC");
	struct can_frame in;
	int64_t t_ns;

	assert_int_equal(bus->ops->send(bus, &out), 0);
	received("t21060F00FFEEDDCC.");
	out.can_dlc = 9;
	assert_int_equal(bus->ops->send(bus, &out), -EINVAL);
	/* This side ignores C, S and O, which python-can sends. */
	SAY("C\rS8\rO\rz\rt190237AB12");
	assert_int_equal(bus->ops->wait(bus, clock_ns + S), 0);
	assert_int_equal(bus->ops->receive(bus, &in, &t_ns), 0);
	SAY("34\rT1FFFFFFF0\r");
	expect("190#37AB");
	expect("1FFFFFFF#");
	assert_int_equal(bus->counts.sent, 1);
	assert_int_equal(bus->counts.received, 2);
	assert_int_equal(bus->counts.broken, 0);
	assert_int_equal(bus->counts.errors, 0);
}

/* No byte is translated, dropped or taken for flow control; junk is counted and skipped. */
TEST(bytes_arrive_unchanged, setup, teardown)
{
	static char junk[3000];
	char all[256];

	for (size_t i = 0; i < sizeof(all); i++)
		all[i] = (char)i;
	/* BEL and CR end broken lines; the line behind CR is too long. */
	say_bytes(all, sizeof(all));
	SAY("\r");
	expect_nothing();
	assert_int_equal(bus->counts.broken, 3);
	/* A byte that is dropped would leave a frame. */
	for (int byte = 0; byte < 256; byte++) {
		char line[] = {'t', '1', '2', '3', '0', (char)byte, '\r'};

		if (byte != '\r' && byte != '\a')
			say_bytes(line, sizeof(line));
	}
	expect_nothing();
	assert_int_equal(bus->counts.broken, 3 + 254);
	/* More than one call of receive takes. */
	memset(junk, 'x', sizeof(junk));
	SAY("\0\0t12\0\rt1231A\r");
	for (int i = 0; i < 3; i++) {
		struct can_frame in;
		int64_t t_ns;

		say_bytes(junk, sizeof(junk));
		assert_int_equal(bus->ops->receive(bus, &in, &t_ns), 0);
	}
	SAY("\r");
	expect_nothing();
	assert_int_equal(bus->counts.broken, 3 + 254 + 3);
}

TEST(filters_are_exact, setup, teardown)
{
	const canid_t mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
	const struct can_filter exact[] = {{0x190, mask}, {0x7ee, mask}};
	const struct can_filter inverse = {0x190 | CAN_INV_FILTER, mask};
	struct can_filter many[CAN_BUS_FILTERS + 1] = {{0}};
	static const char all[] = "t1900\rT000001900\rr1900\rt1910\rt0000\r";

	assert_int_equal(bus->ops->filter(bus, exact, 2), 0);
	SAY(all);
	expect("190#");
	expect_nothing();
	assert_int_equal(bus->ops->filter(bus, &inverse, 1), 0);
	SAY(all);
	expect("00000190#");
	expect("190#R");
	expect("191#");
	expect("000#");
	assert_int_equal(bus->ops->filter(bus, NULL, 0), 0);
	SAY("t1900\r");
	expect("190#");
	assert_int_equal(bus->ops->filter(bus, many, CAN_BUS_FILTERS + 1), -EINVAL);
	assert_int_equal(bus->ops->filter(bus, many, -1), -EINVAL);
}

/* Queries follow a frame each 100 ms; answers become error frames. */
TEST(status_becomes_error_frames, setup, teardown)
{
	static const struct {
		const char *answer;
		int state;
		const char *frame; /* NULL: none */
	} cases[] = {
		{"F00\r", CAN_STATE_ERROR_ACTIVE, NULL},
		{"F04\r", CAN_STATE_ERROR_WARNING, "20000004#000C000000000000"},
		{"F04\r", CAN_STATE_ERROR_WARNING, NULL},
		{"F09\r", CAN_STATE_ERROR_ACTIVE, "20000004#0041000000000000"},
		{"sb000256\r", CAN_STATE_BUS_OFF, "20000040#0000000000000000"},
		{"sa000000\r", CAN_STATE_ERROR_ACTIVE, "20000104#0040000000000000"},
	};
	uint64_t errors = 0;

	clock_ns += 100 * MS;
	bus->ops->send(bus, &sync_frame);
	bus->ops->send(bus, &sync_frame);
	received("t0800.F.t0800.");
	for (size_t i = 0; i < COUNT(cases); i++) {
		say_bytes(cases[i].answer, strlen(cases[i].answer));
		if (cases[i].frame)
			expect(cases[i].frame);
		else
			expect_nothing();
		assert_int_equal(bus->ops->state(bus), cases[i].state);
		errors += !!cases[i].frame;
	}
	assert_int_equal(bus->counts.errors, errors);
	assert_int_equal(bus->counts.overflow, 1);
	assert_int_equal(bus->counts.received, 0);
}

/* Of those of the start one each is none; an adapter without the query is left alone. */
TEST(refusals_are_errors_but_for_the_start, setup, teardown)
{
	SAY("\a\a\r\a\a");
	expect_nothing();
	for (int i = 0; i < 4; i++) {
		clock_ns += 100 * MS;
		bus->ops->send(bus, &sync_frame);
		received(i < 3 ? "t0800.F." : "t0800.");
		if (i == 3)
			break;
		SAY("\r\a");
		expect_nothing();
	}
	assert_int_equal(bus->counts.errors, 0);
	SAY("\a");
	expect("20000004#0002000000000000");
	assert_int_equal(bus->counts.errors, 1);
}

/* An adapter that does not read for a while: accepted frames arrive whole and in order. */
TEST(a_frame_is_sent_whole_or_not, setup, teardown)
{
	struct can_frame frame = {.can_id = 0x210, .can_dlc = 4};
	uint32_t sent = 0;
	int rc;

	do {
		memcpy(frame.data, &sent, 4);
		rc = bus->ops->send(bus, &frame);
		sent += !rc;
	} while (!rc && sent < 100000);
	assert_int_equal(rc, -ENOBUFS);
	assert_int_equal(bus->ops->send(bus, &frame), -ENOBUFS);
	assert_int_equal(bus->counts.full, 2);
	assert_int_equal(bus->counts.sent, sent);
	for (uint32_t seen = 0; seen < sent; seen++) {
		char line[32];

		/* The last line may have been cut: its rest goes out ahead of the next. */
		for (int i = 0; seen == sent - 1 && i < 10000; i++) {
			if (!bus->ops->send(bus, &sync_frame))
				break;
			poll(NULL, 0, 1);
		}
		snprintf(line, sizeof(line), "t2104%02X%02X%02X00.", seen & 0xff,
			 seen >> 8 & 0xff, seen >> 16);
		received(line);
	}
	received("t0800.");
}

TEST(a_torn_line_is_finished_first, setup, teardown)
{
	write_most = 0;
	assert_int_equal(bus->ops->send(bus, &sync_frame), -ENOBUFS);
	write_most = 3;
	write_interrupts = 5;
	assert_int_equal(bus->ops->send(bus, &sync_frame), 0);
	assert_int_equal(bus->ops->send(bus, &other_frame), 0);
	received("t0800.t1230.");
	/* Two bytes went out, and then none do: the rest is kept, ahead of later frames. */
	write_left = 2;
	assert_int_equal(bus->ops->send(bus, &sync_frame), 0);
	assert_int_equal(bus->ops->send(bus, &other_frame), -ENOBUFS);
	assert_int_equal(bus->ops->wait(bus, 0), 0);
	received("t0");
	write_all();
	assert_int_equal(bus->ops->wait(bus, 0), 0);
	received("800.");
	assert_int_equal(bus->ops->send(bus, &other_frame), 0);
	received("t1230.");
	assert_int_equal(bus->counts.full, 2);
	assert_int_equal(bus->counts.sent, 4);
	/* Closing a stuck line ends. */
	write_most = 0;
	assert_int_equal(bus->ops->send(bus, &sync_frame), -ENOBUFS);
	close_bus();
}

TEST(an_error_of_the_line_is_permanent)
{
	static const struct {
		int error, rc;
	} cases[] = {{EIO, -ENODEV}, {ENXIO, -ENODEV}, {ENODEV, -ENODEV}, {EPERM, -EIO}};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct can_frame in;

		adapter_new();
		assert_int_equal(open_device(&bus, path, 0), 0);
		write_error = cases[i].error;
		assert_int_equal(bus->ops->send(bus, &sync_frame), cases[i].rc);
		write_error = 0;
		assert_int_equal(bus->ops->send(bus, &sync_frame), cases[i].rc);
		assert_int_equal(next(&in), cases[i].rc);
		close_bus();
		close(fd);
	}
}

/* Found by receiving, or by sending. */
TEST(an_adapter_that_is_unplugged_is_gone)
{
	for (int sends = 0; sends < 2; sends++) {
		struct can_frame in;

		adapter_new();
		assert_int_equal(open_device(&bus, path, 0), 0);
		close(fd);
		if (!sends)
			assert_int_equal(next(&in), -ENODEV);
		assert_int_equal(bus->ops->send(bus, &sync_frame), -ENODEV);
		assert_int_equal(next(&in), -ENODEV);
		assert_int_equal(bus->ops->wait(bus, INT64_MAX), -ENODEV);
		close_bus();
	}
}

/* The speed that stty set stays; the default of a port that nobody set does not. */
TEST(the_speed_is_the_users, setup, teardown)
{
	static const struct {
		speed_t set, is;
	} cases[] = {{B9600, B115200}, {B115200, B115200}, {B1000000, B1000000}};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct termios t;

		assert_int_equal(tcgetattr(fd, &t), 0);
		cfsetspeed(&t, cases[i].set);
		assert_int_equal(tcsetattr(fd, TCSANOW, &t), 0);
		close_bus();
		assert_int_equal(open_device(&bus, path, 0), 0);
		assert_int_equal(tcgetattr(fd, &t), 0);
		assert_int_equal(cfgetospeed(&t), cases[i].is);
		assert_int_equal(t.c_lflag & (ICANON | ECHO | ISIG), 0);
	}
}

/* A late reader: frames sent before close() wait in the pty, and stay there. */
TEST(the_last_frames_arrive, setup, teardown)
{
	const struct can_frame last = {.can_id = 0x000, .can_dlc = 2, .data = {0x80, 16}};

	/* More than the 4096 bytes that the reader's side of a pty takes by itself. */
	for (int i = 0; i < 700; i++)
		assert_int_equal(bus->ops->send(bus, &sync_frame), 0);
	assert_int_equal(bus->ops->send(bus, &last), 0);
	close_bus();
	for (int i = 0; i < 700; i++)
		received("t0800.");
	received("t00028010.C.");
}

TEST(waiting_ends, setup, teardown)
{
	int64_t begin = clock_ns, t_ns;
	struct can_frame in;

	/* A time in the past: at once, even without input. */
	quiet = true;
	assert_int_equal(bus->ops->wait(bus, 0), 0);
	assert_int_equal(bus->ops->wait(bus, INT64_MIN + begin), 0);
	assert_int_equal(bus->ops->now(bus), begin);
	assert_int_equal(bus->ops->wait(bus, begin + 5 * MS), 0);
	assert_int_equal(bus->ops->now(bus), begin + 5 * MS);
	/* Two frames arrive at once: the second one needs no wait. */
	quiet = false;
	SAY("t1230\rt1240\r");
	assert_int_equal(bus->ops->wait(bus, INT64_MAX), 0);
	assert_int_equal(bus->ops->receive(bus, &in, &t_ns), 1);
	assert_int_equal(bus->ops->wait(bus, INT64_MAX), 0);
}
