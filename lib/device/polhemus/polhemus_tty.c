// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker of Polhemus at a serial line, "tty:/dev/ttyUSB0:115200"; see polhemus_tty.h.
 */
#include <dirent.h>
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
#include "../../rig/backends.h"
#include "../../rig/tty.h"
#include "polhemus_setup.h"
#include "polhemus_tracker.h"
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

/* A line that was unplugged answers EIO, or nothing at all. */
static int failed_polhemus_tty(int code)
{
	return code == EIO || code == ENXIO || code == ENODEV || code == EBADF ? -ENODEV
									       : -EIO;
}

static int tty_write(struct polhemus_line *line, const void *bytes, size_t n)
{
	struct polhemus_tty *tty = of_line(line);
	const char *at = bytes;

	while (n) {
		struct pollfd writable = {.fd = tty->fd, .events = POLLOUT};
		ssize_t m = tty->fd < 0 ? (errno = ENODEV, -1) : write(tty->fd, at, n);

		if (m >= 0) {
			at += m;
			n -= (size_t)m;
		} else if (errno == EAGAIN) {
			if (poll(&writable, 1, WRITE_MS) <= 0)
				return -EIO;
		} else if (errno != EINTR) {
			return failed_polhemus_tty(errno);
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
	/* A signal that the program gets during the setup does not end the wait. */
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
			return failed_polhemus_tty(errno);
	}
	return 0;
}

static void let_go(struct polhemus_tty *tty)
{
	if (tty->fd < 0)
		return;
	/* Bytes that it does not accept must not delay close() by 30 s. */
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

/* "PATH:RATE" or "PATH"; a path may have colons of its own. 0 or -EINVAL. */
static int parse_polhemus_tty(struct polhemus_tty *tty, const char *arguments)
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
	struct polhemus_tty *tty = incise_backend_alloc(sizeof(*tty), where, err);
	const char *tail;

	if (!tty)
		return NULL;
	tty->line.ops = &ops;
	tty->line.family = -1;
	if (parse_polhemus_tty(tty, arguments)) {
		incise_error_set(
			err, EINVAL,
			"%s: tty:%.100s: expected tty:/dev/ttyUSB0:RATE, with RATE "
			"9600, 19200, 38400, 57600 or 115200; correct it",
			where, arguments);
		free(tty);
		errno = EINVAL;
		return NULL;
	}
	/* The ends of long paths differ. */
	tail = tty->path + strlen(tty->path);
	if ((size_t)(tail - tty->path) >= sizeof(tty->line.name))
		tail -= sizeof(tty->line.name) - 1;
	else
		tail = tty->path;
	strcpy(tty->line.name, tail);
	tty->fd = incise_tty_open(tty->path, tty->speed);
	if (tty->fd < 0) {
		int rc = incise_tty_refuse(tty->path, -tty->fd, where,
					   "that of a tracker", err);

		free(tty);
		errno = -rc;
		return NULL;
	}
	return &tty->line;
}

/* --- backend --- */

#define BY_ID "/dev/serial/by-id"

static void *open_tracker(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	struct polhemus_line *line =
		polhemus_tty_open(request->arguments, request->where, err);

	return line ? polhemus_tracker_open(line, request->tracker, &POLHEMUS_TIMES,
					    request->where, err)
		    : NULL;
}

/* List all lines unasked: asking might disturb another device. */
static int list_lines(incise_scan_found *found, void *context)
{
	DIR *folder = opendir(BY_ID);
	struct dirent *entry;
	int rc = 0;

	while (folder && !rc && (entry = readdir(folder))) {
		struct incise_scan_device device = {0};

		if (entry->d_name[0] == '.')
			continue;
		if (snprintf(device.device, sizeof(device.device),
			     "tty:" BY_ID "/%s:115200",
			     entry->d_name) >= (int)sizeof(device.device))
			continue;
		device.usable = true;
		snprintf(device.what, sizeof(device.what),
			 "a serial port, not probed; a tracker may be behind it");
		rc = found(context, &device);
	}
	if (folder)
		closedir(folder);
	return rc;
}

/* Ask a line that is named. */
static int scan(const char *arguments, incise_scan_found *found, void *context,
		struct incise_error *err)
{
	struct incise_scan_device device = {0};
	struct polhemus_identity identity;
	struct polhemus_line *line;
	char where[120], sensors[8];
	int rc;

	if (!*arguments)
		return list_lines(found, context);
	snprintf(where, sizeof(where), "tty:%.100s", arguments);
	line = polhemus_tty_open(arguments, where, err);
	if (!line)
		return -errno;
	rc = polhemus_identify(line, &identity, where, err);
	line->ops->close(line);
	if (rc)
		return rc;
	if (snprintf(device.device, sizeof(device.device), "tty:%s", arguments) >=
	    (int)sizeof(device.device))
		return incise_error_set(err, EINVAL,
					"%s: the path is too long; use a shorter one",
					where);
	device.usable = true;
	snprintf(device.what, sizeof(device.what), "%s", identity.name);
	incise_scan_tell(&device, "family", "%s",
			 polhemus_family_name(identity.layout.family));
	if (identity.version[0])
		incise_scan_tell(&device, "firmware", "%s", identity.version);
	if (identity.sensors >= 0) {
		size_t n = 0;

		for (int i = 0; i < POLHEMUS_STATIONS; i++)
			if (identity.sensors >> i & 1)
				sensors[n++] = (char)('1' + i);
		sensors[n] = '\0';
		incise_scan_tell(&device, "sensors", "%s", sensors);
	}
	/* From the self-test of a FASTRAK at power-on. */
	if (identity.test_error)
		incise_scan_tell(&device, "self_test_error", "%d", identity.test_error);
	return found(context, &device);
}

INCISE_BACKEND(incise_tracker_tty, "tracker", "tty", .open = open_tracker, .scan = scan);
