// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The serial line to a tracker; see polhemus_tty.h.
 */
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>
#include "../../base/monotonic.h"
#include "../tty.h"
#include "polhemus_tty.h"

#define WRITE_MS 1000
#define NS_PER_MS INT64_C(1000000)
#define BITS 10 /* of a byte on the line: start, 8, stop */

struct polhemus_tty {
	struct polhemus_line line;
	char path[PATH_MAX];
	speed_t speed;
	int fd;
};

static const struct {
	int baud;
	speed_t speed;
} speeds[] = {
	{9600, B9600},	 {19200, B19200},   {38400, B38400},
	{57600, B57600}, {115200, B115200},
};

static struct polhemus_tty *of_line(struct polhemus_line *line)
{
	return (struct polhemus_tty *)line;
}

/* A line that was pulled out answers EIO, or nothing at all. */
static int failed(int code)
{
	return code == EIO || code == ENXIO || code == ENODEV || code == EBADF ? -ENODEV
									       : -EIO;
}

static int tty_write(struct polhemus_line *line, const void *bytes, size_t n)
{
	struct polhemus_tty *tty = of_line(line);
	const char *at = bytes;

	while (n) {
		struct pollfd room = {.fd = tty->fd, .events = POLLOUT};
		ssize_t m = tty->fd < 0 ? (errno = ENODEV, -1) : write(tty->fd, at, n);

		if (m >= 0) {
			at += m;
			n -= (size_t)m;
		} else if (errno == EAGAIN) {
			if (poll(&room, 1, WRITE_MS) <= 0)
				return -EIO;
		} else if (errno != EINTR) {
			return failed(errno);
		}
	}
	return 0;
}

static ssize_t tty_read(struct polhemus_line *line, void *bytes, size_t size,
			int64_t *t_ns, int timeout_ms)
{
	struct polhemus_tty *tty = of_line(line);
	struct pollfd waits = {.fd = tty->fd, .events = POLLIN};
	int64_t end_ns = incise_monotonic_ns() + timeout_ms * NS_PER_MS, left_ns;

	if (tty->fd < 0)
		return -ENODEV;
	/* While it is set up a signal of the program may come, which is no end of time. */
	while ((left_ns = end_ns - incise_monotonic_ns()) > 0) {
		ssize_t n;

		if (!poll(&waits, 1, (int)((left_ns + NS_PER_MS - 1) / NS_PER_MS)))
			break;
		n = read(tty->fd, bytes, size);
		*t_ns = incise_monotonic_ns();
		/* VMIN is 1: no byte is the end, not a pause. */
		if (n >= 0)
			return n ? n : -ENODEV;
		if (errno != EAGAIN && errno != EINTR)
			return failed(errno);
	}
	return 0;
}

static void let_go(struct polhemus_tty *tty)
{
	if (tty->fd < 0)
		return;
	/* What it does not take must not hold up close(), for 30 s. */
	tcflush(tty->fd, TCOFLUSH);
	ioctl(tty->fd, TIOCNXCL);
	close(tty->fd);
	tty->fd = -1;
}

static int tty_reopen(struct polhemus_line *line)
{
	struct polhemus_tty *tty = of_line(line);
	int fd;

	let_go(tty);
	fd = incise_tty_open(tty->path, tty->speed);
	if (fd < 0)
		return fd;
	tty->fd = fd;
	return 0;
}

static void tty_close(struct polhemus_line *line)
{
	let_go(of_line(line));
	free(line);
}

static const struct polhemus_line_ops ops = {
	.write = tty_write,
	.read = tty_read,
	.reopen = tty_reopen,
	.close = tty_close,
};

static void refuse(const char *path, int code, const char *where,
		   struct incise_error *err)
{
	switch (code) {
	case ENOENT:
	case ENOTDIR:
	case ELOOP:
	case ENXIO:
	case ENODEV:
		incise_error_set(err, ENODEV,
				 "%s: %s is not there: is the adapter plugged in? "
				 "/dev/serial/by-id lists those that are",
				 where, path);
		break;
	case EACCES:
	case EPERM:
		incise_error_set(err, EACCES,
				 "%s: no right to open %s: join the group that owns it, "
				 "which mostly is dialout",
				 where, path);
		break;
	case EBUSY:
	case EWOULDBLOCK:
		incise_error_set(err, EBUSY,
				 "%s: another program has %s open: end it first", where,
				 path);
		break;
	case ENOTTY:
		incise_error_set(err, EINVAL,
				 "%s: %s is no serial line: expected one such as "
				 "/dev/ttyUSB0",
				 where, path);
		break;
	case EINVAL:
		incise_error_set(err, EIO,
				 "%s: %s cannot run at this rate: choose another one, "
				 "here and at the tracker's switches",
				 where, path);
		break;
	default:
		incise_error_set(err, EIO, "%s: %s: %s: plug the adapter out and in",
				 where, path, strerror(code));
	}
}

/* "PATH:RATE" or "PATH"; a path may have colons of its own. 0 or -EINVAL. */
static int parse(struct polhemus_tty *tty, const char *arguments)
{
	const char *colon = strrchr(arguments, ':');
	int baud = 115200;
	size_t n;

	if (colon && colon[1] && colon[strspn(colon + 1, "0123456789") + 1] == '\0')
		baud = strlen(colon + 1) < 8 ? atoi(colon + 1) : 0;
	else
		colon = NULL;
	n = colon ? (size_t)(colon - arguments) : strlen(arguments);
	if (!n || n >= sizeof(tty->path) || arguments[0] != '/')
		return -EINVAL;
	memcpy(tty->path, arguments, n);
	tty->path[n] = '\0';
	for (size_t i = 0; i < sizeof(speeds) / sizeof(*speeds); i++)
		if (speeds[i].baud == baud) {
			tty->speed = speeds[i].speed;
			tty->line.ns_per_byte = BITS * INT64_C(1000000000) / baud;
			return 0;
		}
	return -EINVAL;
}

struct polhemus_line *polhemus_tty_open(const char *arguments, const char *where,
					struct incise_error *err)
{
	struct polhemus_tty *tty = calloc(1, sizeof(*tty));
	const char *tail;

	if (!tty) {
		incise_error_set(err, ENOMEM, "%s: out of memory: end other programs",
				 where);
		return NULL;
	}
	tty->line.ops = &ops;
	tty->line.family = -1;
	if (parse(tty, arguments)) {
		incise_error_set(
			err, EINVAL,
			"%s: tty:%.100s: expected tty:/dev/ttyUSB0:RATE, with RATE "
			"9600, 19200, 38400, 57600 or 115200; correct it",
			where, arguments);
		free(tty);
		errno = EINVAL;
		return NULL;
	}
	/* The end of a long path tells most. */
	tail = tty->path + strlen(tty->path);
	if ((size_t)(tail - tty->path) >= sizeof(tty->line.name))
		tail -= sizeof(tty->line.name) - 1;
	else
		tail = tty->path;
	strcpy(tty->line.name, tail);
	tty->fd = incise_tty_open(tty->path, tty->speed);
	if (tty->fd < 0) {
		struct incise_error none;

		refuse(tty->path, -tty->fd, where, err ? err : &none);
		free(tty);
		errno = err ? err->code : none.code;
		return NULL;
	}
	return &tty->line;
}
