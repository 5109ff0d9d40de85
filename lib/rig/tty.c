// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A serial line; see tty.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <linux/serial.h>
#include "tty.h"

static int set_raw(int fd, speed_t speed)
{
	struct serial_struct serial;
	struct termios t, is;

	if (tcgetattr(fd, &t) < 0)
		return -ENOTTY;
	cfmakeraw(&t);
	t.c_cflag |= CLOCAL | CREAD;
	t.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS | PARENB);
	t.c_iflag &= ~(tcflag_t)(IXOFF | IXANY | INPCK);
	t.c_cc[VMIN] = 1;
	t.c_cc[VTIME] = 0;
	if (speed != B0)
		cfsetspeed(&t, speed);
	else if (cfgetospeed(&t) == B9600)
		cfsetspeed(&t, B115200);
	if (tcsetattr(fd, TCSANOW, &t) < 0)
		return -errno;
	/* tcsetattr() also succeeds when only some settings were made. */
	if (tcgetattr(fd, &is) < 0 || (speed != B0 && cfgetospeed(&is) != speed))
		return -EINVAL;
	/* Else an FTDI adapter holds bytes back for 16 ms. Not every line supports it. */
	if (!ioctl(fd, TIOCGSERIAL, &serial)) {
		serial.flags |= ASYNC_LOW_LATENCY;
		ioctl(fd, TIOCSSERIAL, &serial);
	}
	return 0;
}

int incise_tty_open(const char *path, speed_t speed)
{
	struct stat is;
	int fd, rc;

	/* Opening another file may block, or have side effects. */
	if (stat(path, &is) < 0)
		return -errno;
	if (!S_ISCHR(is.st_mode))
		return -ENOTTY;
	fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0)
		return -errno;
	/* TIOCEXCL does not exclude root; the lock does, for programs that use it. */
	if (!isatty(fd))
		rc = -ENOTTY;
	else if (flock(fd, LOCK_EX | LOCK_NB) < 0 || ioctl(fd, TIOCEXCL) < 0)
		rc = -errno;
	else
		rc = set_raw(fd, speed);
	if (rc) {
		close(fd);
		return rc;
	}
	tcflush(fd, TCIOFLUSH);
	return fd;
}

int incise_tty_refuse(const char *path, int code, const char *where, const char *expected,
		      struct incise_error *err)
{
	switch (code) {
	case ENOENT:
	case ENOTDIR:
	case ELOOP:
	case ENXIO:
	case ENODEV:
		return incise_error_set(err, ENODEV,
					"%s: no such device %s; plug in the adapter; "
					"/dev/serial/by-id lists the serial ports",
					where, path);
	case EACCES:
	case EPERM:
		return incise_error_set(
			err, EACCES,
			"%s: no permission to open %s; join its group, usually dialout",
			where, path);
	case EBUSY:
	case EWOULDBLOCK:
		return incise_error_set(err, EBUSY,
					"%s: another program has %s open; end it first",
					where, path);
	case ENOTTY:
		return incise_error_set(err, EINVAL,
					"%s: %s is not a serial port; expected %s, for "
					"example /dev/ttyUSB0",
					where, path, expected);
	case EINVAL:
		return incise_error_set(err, EIO,
					"%s: %s does not support this baud rate; choose "
					"another, here and at the device's switches",
					where, path);
	default:
		return incise_error_set(err, EIO,
					"%s: %s: %s; unplug the adapter and plug it in",
					where, path, strerror(code));
	}
}
