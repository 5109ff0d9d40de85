/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A serial line, for one program alone: bytes as they are, 8N1, no flow control.
 */
#ifndef INCISE_TTY_H
#define INCISE_TTY_H

#include <termios.h>
#include <incise/error.h>

/*
 * @speed  B115200 …; B0 keeps the speed set by stty, as over USB it mostly has no meaning; but
 *         9600, the default of a port, becomes 115200
 *
 * A non-blocking descriptor without old bytes, to be closed after TIOCNXCL; or -ENOENT,
 * -EACCES, -EBUSY or -EWOULDBLOCK (another program has it), -ENOTTY, -EINVAL (not at that
 * speed).
 */
int incise_tty_open(const char *path, speed_t speed);

/*
 * Make the message for an error of incise_tty_open(), a positive @code. @expected: the line that
 * is asked for. Returns the error: -ENODEV, -EACCES, -EBUSY, -EINVAL, -EIO.
 */
int incise_tty_refuse(const char *path, int code, const char *where, const char *expected,
		      struct incise_error *err);

#endif
