/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The serial line to a tracker: 8N1, no flow control, for this program alone.
 */
#ifndef INCISE_POLHEMUS_TTY_H
#define INCISE_POLHEMUS_TTY_H

#include <incise/error.h>
#include "polhemus_line.h"

/*
 * @arguments "/dev/ttyUSB0:115200"; without a rate it is 115200. NULL with errno EINVAL,
 * ENODEV, EACCES, EBUSY, ENOMEM, EIO.
 */
struct polhemus_line *polhemus_tty_open(const char *arguments, const char *where,
					struct incise_error *err);

#endif
