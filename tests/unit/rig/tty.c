// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/tty.c on pseudo terminals. A line's speed means nothing there, but is kept.
 */
#include "../unit.h"
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include "../../../lib/rig/tty.h"

static int master;
static char path[64];

static int make(void **state)
{
	master = posix_openpt(O_RDWR | O_NOCTTY);
	return master < 0 || grantpt(master) || unlockpt(master) ||
	       ptsname_r(master, path, sizeof(path));
}

static int drop(void **state)
{
	return close(master);
}

static void let_go(int fd)
{
	ioctl(fd, TIOCNXCL);
	close(fd);
}

TEST(bytes_are_as_they_are, make, drop)
{
	/* what a terminal that is not raw would change, hold back or answer */
	static const unsigned char bytes[] = {0,    3,	  4,	'\r', '\n',
					      0x11, 0x13, 0x7f, 0xff, 'a'};
	unsigned char got[sizeof(bytes) + 1];
	int fd = incise_tty_open(path, B115200);

	assert_true(fd >= 0);
	assert_int_equal(write(master, bytes, sizeof(bytes)), sizeof(bytes));
	assert_int_equal(read(fd, got, sizeof(got)), sizeof(bytes));
	assert_memory_equal(got, bytes, sizeof(bytes));
	assert_int_equal(write(fd, bytes, sizeof(bytes)), sizeof(bytes));
	assert_int_equal(read(master, got, sizeof(got)), sizeof(bytes));
	assert_memory_equal(got, bytes, sizeof(bytes));
	/* and it does not wait */
	assert_int_equal(read(fd, got, sizeof(got)), -1);
	assert_int_equal(errno, EAGAIN);
	let_go(fd);
}

TEST(speeds, make, drop)
{
	static const struct {
		speed_t before, asked, is;
	} cases[] = {
		{B38400, B115200, B115200},
		{B115200, B9600, B9600},
		{B38400, B0, B38400}, /* as stty set it */
		{B9600, B0, B115200}, /* as nobody set it */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct termios t;
		int fd;

		assert_int_equal(tcgetattr(master, &t), 0);
		cfsetspeed(&t, cases[i].before);
		assert_int_equal(tcsetattr(master, TCSANOW, &t), 0);
		fd = incise_tty_open(path, cases[i].asked);
		assert_true(fd >= 0);
		assert_int_equal(tcgetattr(fd, &t), 0);
		if (cfgetospeed(&t) != cases[i].is)
			fail_msg("case %zu: speed %#o", i, cfgetospeed(&t));
		let_go(fd);
	}
}

TEST(what_lies_there_is_of_another_time, make, drop)
{
	int keep = open(path, O_RDWR | O_NOCTTY), fd;
	char got[4];

	assert_true(keep >= 0);
	assert_int_equal(write(master, "old\n", 4), 4);
	fd = incise_tty_open(path, B115200);
	assert_true(fd >= 0);
	assert_int_equal(read(fd, got, sizeof(got)), -1);
	let_go(fd);
	close(keep);
}

TEST(one_program_at_a_time, make, drop)
{
	int fd = incise_tty_open(path, B115200);
	int second = incise_tty_open(path, B115200);

	assert_true(fd >= 0);
	/* TIOCEXCL, or for root, whom that does not stop, the lock */
	assert_true(second == -EBUSY || second == -EWOULDBLOCK);
	let_go(fd);
	fd = incise_tty_open(path, B115200);
	assert_true(fd >= 0);
	let_go(fd);
}

TEST(what_is_no_line, make, drop)
{
	char file[] = "/tmp/incise-test-XXXXXX";

	close(mkstemp(file));
	assert_int_equal(incise_tty_open(file, B115200), -ENOTTY);
	unlink(file);
	/* to open one without a writer would wait */
	assert_int_equal(mkfifo(file, 0600), 0);
	assert_int_equal(incise_tty_open(file, B115200), -ENOTTY);
	unlink(file);
	assert_int_equal(incise_tty_open(file, B115200), -ENOENT);
	assert_int_equal(incise_tty_open("/dev/null", B115200), -ENOTTY);
	assert_int_equal(incise_tty_open("/", B115200), -ENOTTY);
}
