/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A serial line, for one program alone: bytes as they are, 8N1, no flow control.
 */
#ifndef INCISE_TTY_H
#define INCISE_TTY_H

#include <termios.h>

/*
 * @speed  B115200 …; B0 leaves what stty set: over USB it mostly means nothing, and where it
 *         does only the user knows. But 9600, which a port has when nobody set it, becomes
 *         115200
 *
 * A descriptor that does not block and has no bytes of another time, to be closed after
 * TIOCNXCL; or -ENOENT, -EACCES, -EBUSY or -EWOULDBLOCK (another program has it), -ENOTTY,
 * -EINVAL (not at that speed).
 */
int incise_tty_open(const char *path, speed_t speed);

#endif
