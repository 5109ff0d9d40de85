// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The serial line to an adapter that speaks slcan; see slcan_tty.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include "../../tty.h"
#include "slcan_tty.h"

#define DRAIN_POLLS 20 /* of 5 ms, until the last bytes have gone */

/* A line that was pulled out answers EIO; it does not come back on this descriptor. */
static int failed(struct slcan_tty *tty, int code)
{
	tty->gone = code == EIO || code == ENXIO || code == ENODEV ? -ENODEV : -EIO;
	return tty->gone;
}

int slcan_tty_flush(struct slcan_tty *tty)
{
	while (tty->out_at < tty->out_n) {
		ssize_t n =
			write(tty->fd, tty->out + tty->out_at, tty->out_n - tty->out_at);

		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0 && errno != EAGAIN)
			return failed(tty, errno);
		if (n <= 0)
			return -ENOBUFS;
		tty->out_at += (unsigned int)n;
	}
	tty->out_at = tty->out_n = 0;
	return 0;
}

int slcan_tty_put(struct slcan_tty *tty, const char *text, unsigned int n)
{
	int rc = tty->gone ? tty->gone : slcan_tty_flush(tty);

	if (rc)
		return rc;
	memcpy(tty->out, text, n);
	tty->out_n = n;
	rc = slcan_tty_flush(tty);
	if (rc == -ENOBUFS) {
		if (tty->out_at)
			return 0;
		tty->out_n = 0;
	}
	return rc;
}

ssize_t slcan_tty_read(struct slcan_tty *tty, void *bytes, size_t size)
{
	ssize_t n;

	if (tty->gone)
		return tty->gone;
	do
		n = read(tty->fd, bytes, size);
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return errno == EAGAIN ? 0 : failed(tty, errno);
	/* VMIN is 1: no byte is the end, not a pause. */
	return n ? n : failed(tty, EIO);
}

static int refuse(const char *path, int code, const char *where, struct incise_error *err)
{
	switch (code) {
	case ENOENT:
	case ENXIO:
	case ENODEV:
		return incise_error_set(err, ENODEV,
					"%s: %s is not there: is the adapter plugged in? "
					"/dev/serial/by-id lists those that are",
					where, path);
	case EACCES:
	case EPERM:
		return incise_error_set(
			err, EACCES,
			"%s: no right to open %s: join the group that owns "
			"it, which mostly is dialout",
			where, path);
	case EBUSY:
	case EWOULDBLOCK:
		return incise_error_set(
			err, EBUSY,
			"%s: another program has %s open: end it first, or "
			"drive from one place only",
			where, path);
	case ENOTTY:
	case EINVAL:
		return incise_error_set(
			err, EINVAL,
			"%s: %s is no serial line: expected the tty of an "
			"adapter that speaks slcan, such as /dev/ttyACM0",
			where, path);
	case ENOMEM:
		return incise_error_set(err, ENOMEM, "%s: out of memory", where);
	default:
		return incise_error_set(err, EIO, "%s: %s: %s", where, path,
					strerror(code));
	}
}

int slcan_tty_open(struct slcan_tty *tty, const char *path, const char *where,
		   struct incise_error *err)
{
	*tty = (struct slcan_tty){.fd = incise_tty_open(path, B0)};
	return tty->fd < 0 ? refuse(path, -tty->fd, where, err) : 0;
}

/*
 * The adapter must have read the last bytes before the line goes. What it does not take is
 * thrown away: to close a tty may wait 30 s for it. But only then: on a pty that would throw
 * away what the other side has not read yet.
 */
void slcan_tty_close(struct slcan_tty *tty, const char *last, unsigned int n)
{
	bool told = false, gone = false;
	int left = 0;

	for (int i = 0; i < DRAIN_POLLS && !gone && !tty->gone; i++) {
		told = told || !slcan_tty_put(tty, last, n);
		gone = told && !slcan_tty_flush(tty) &&
		       (ioctl(tty->fd, TIOCOUTQ, &left) < 0 || !left);
		if (!gone)
			nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
	}
	if (!gone)
		tcflush(tty->fd, TCOFLUSH);
	ioctl(tty->fd, TIOCNXCL);
	close(tty->fd);
}
