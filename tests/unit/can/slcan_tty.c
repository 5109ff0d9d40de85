// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan_tty.c on a pseudo terminal. What it does for a bus is in slcan.c.
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
#include <unistd.h>
#include "../../../lib/device/can/bus/slcan_tty.h"

/* What write() does next: takes so many bytes (-1: all), after so many signals, or fails. */
static ssize_t write_most;
static int write_interrupts, write_error;

ssize_t __real_write(int fd, const void *bytes, size_t n);

ssize_t __wrap_write(int fd, const void *bytes, size_t n)
{
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
	return n ? __real_write(fd, bytes, n) : 0;
}

static int master;
static char path[64];
static struct slcan_tty tty;

static int setup(void **state)
{
	struct incise_error err = {0};

	write_most = -1;
	write_interrupts = write_error = 0;
	master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
	assert_true(master >= 0 && !grantpt(master) && !unlockpt(master));
	assert_int_equal(ptsname_r(master, path, sizeof(path)), 0);
	assert_int_equal(slcan_tty_open(&tty, path, "rig.conf:1: stepper", &err), 0);
	return 0;
}

static int teardown(void **state)
{
	write_most = -1;
	write_interrupts = write_error = 0;
	slcan_tty_close(&tty, "", 0);
	if (master >= 0)
		close(master);
	return 0;
}

/* What arrived is just this. */
static void arrives(const char *text)
{
	struct pollfd poll_fd = {.fd = master, .events = POLLIN};
	char got[200];
	size_t n = 0;

	while (n < strlen(text) && poll(&poll_fd, 1, 1000) == 1) {
		ssize_t more = read(master, got + n, sizeof(got) - 1 - n);

		assert_true(more > 0);
		n += (size_t)more;
	}
	got[n] = '\0';
	assert_string_equal(got, text);
	poll_fd.revents = 0;
	poll(&poll_fd, 1, 0);
	assert_false(poll_fd.revents & POLLIN);
}

static void what_is_torn_is_finished_first(void **state)
{
	write_most = 0;
	assert_int_equal(slcan_tty_put(&tty, "none", 4), -ENOBUFS);
	assert_int_equal(tty.out_n, 0);
	write_most = 3;
	write_interrupts = 5;
	assert_int_equal(slcan_tty_put(&tty, "0123456789", 10), 0);
	arrives("0123456789");
	/* Two bytes went, and then none do: the rest is kept, and goes before what comes after. */
	memcpy(tty.out, "abcdef", 6);
	tty.out_n = 6;
	tty.out_at = 2;
	write_most = 0;
	assert_int_equal(slcan_tty_put(&tty, "never", 5), -ENOBUFS);
	assert_int_equal(slcan_tty_flush(&tty), -ENOBUFS);
	write_most = -1;
	assert_int_equal(slcan_tty_put(&tty, "gh", 2), 0);
	arrives("cdefgh");
	assert_int_equal(tty.out_n, 0);
}

static void what_fails_is_for_good(void **state)
{
	static const struct {
		int error, rc;
	} cases[] = {{EIO, -ENODEV}, {ENXIO, -ENODEV}, {ENODEV, -ENODEV}, {EPERM, -EIO}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char byte;

		tty.gone = 0;
		tty.out_n = tty.out_at = 0;
		write_error = cases[i].error;
		assert_int_equal(slcan_tty_put(&tty, "x", 1), cases[i].rc);
		write_error = 0;
		assert_int_equal(slcan_tty_put(&tty, "x", 1), cases[i].rc);
		assert_int_equal(slcan_tty_read(&tty, &byte, 1), cases[i].rc);
	}
}

static void bytes_come_as_they_are(void **state)
{
	char all[255], got[sizeof(all)];
	struct pollfd poll_fd = {.fd = tty.fd, .events = POLLIN};
	size_t n = 0;

	assert_int_equal(slcan_tty_read(&tty, got, sizeof(got)), 0);
	for (size_t i = 0; i < sizeof(all); i++)
		all[i] = (char)i;
	assert_int_equal(__real_write(master, all, sizeof(all)), sizeof(all));
	while (n < sizeof(all) && poll(&poll_fd, 1, 1000) == 1) {
		ssize_t more = slcan_tty_read(&tty, got + n, sizeof(got) - n);

		assert_true(more > 0);
		n += (size_t)more;
	}
	assert_int_equal(n, sizeof(all));
	assert_memory_equal(got, all, sizeof(all));
	close(master);
	master = -1;
	assert_int_equal(slcan_tty_read(&tty, got, sizeof(got)), -ENODEV);
}

static void the_last_bytes_go_out(void **state)
{
	struct incise_error err = {0};

	assert_int_equal(slcan_tty_put(&tty, "t0800\r", 6), 0);
	slcan_tty_close(&tty, "C\r", 2);
	arrives("t0800\rC\r");
	assert_int_equal(slcan_tty_open(&tty, path, "x", &err), 0);
	/* And it ends where nothing goes out any more, or the line is gone. */
	write_most = 0;
	slcan_tty_close(&tty, "C\r", 2);
	assert_int_equal(slcan_tty_open(&tty, path, "x", &err), 0);
	tty.gone = -ENODEV;
}

static void it_is_ours_alone(void **state)
{
	struct incise_error err = {0};
	struct slcan_tty other;

	assert_int_equal(slcan_tty_open(&other, path, "rig.conf:1: stepper", &err),
			 -EBUSY);
	assert_ptr_equal(strstr(err.text,
				"rig.conf:1: stepper: another program has /dev"),
			 err.text);
	slcan_tty_close(&tty, "", 0);
	assert_int_equal(slcan_tty_open(&tty, path, "x", &err), 0);
}

/* The speed that stty set stays; that of a port which nobody set does not. */
static void the_speed_is_the_users(void **state)
{
	static const struct {
		speed_t set, is;
	} cases[] = {{B9600, B115200}, {B115200, B115200}, {B1000000, B1000000}};
	struct incise_error err = {0};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct termios t;

		assert_int_equal(tcgetattr(tty.fd, &t), 0);
		cfsetspeed(&t, cases[i].set);
		assert_int_equal(tcsetattr(tty.fd, TCSANOW, &t), 0);
		slcan_tty_close(&tty, "", 0);
		assert_int_equal(slcan_tty_open(&tty, path, "x", &err), 0);
		assert_int_equal(tcgetattr(tty.fd, &t), 0);
		assert_int_equal(cfgetospeed(&t), cases[i].is);
		assert_int_equal(t.c_lflag & (ICANON | ECHO | ISIG), 0);
	}
}

static void what_is_no_serial_line_is_refused(void **state)
{
	char folder[] = "/tmp/incise-tty-XXXXXX", file[64], pipe[64];
	struct {
		const char *path;
		int code;
		const char *words;
	} cases[] = {
		{file, -EINVAL, "is no serial line"},
		{pipe, -EINVAL, "is no serial line"},
		{folder, -EINVAL, "is no serial line"},
		{"/dev/null", -EINVAL, "is no serial line"},
		{"", -ENODEV, "is not there"},
		{"/dev/ttyACM4711", -ENODEV, "is the adapter plugged in"},
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
		struct slcan_tty none;

		assert_int_equal(slcan_tty_open(&none, cases[i].path, "x", &err),
				 cases[i].code);
		assert_int_equal(err.code, -cases[i].code);
		assert_non_null(strstr(err.text, cases[i].words));
	}
	unlink(file);
	unlink(pipe);
	rmdir(folder);
}

#define WITH(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		WITH(what_is_torn_is_finished_first),
		WITH(what_fails_is_for_good),
		WITH(bytes_come_as_they_are),
		WITH(the_last_bytes_go_out),
		WITH(it_is_ours_alone),
		WITH(the_speed_is_the_users),
		cmocka_unit_test(what_is_no_serial_line_is_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
