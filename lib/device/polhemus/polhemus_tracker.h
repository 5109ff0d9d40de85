/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A tracker of Polhemus as struct incise_tracker, on any line.
 *
 * A thread reads the line and puts samples into a ring; incise_tracker_read() takes them
 * from there, which is real-time safe. A sample's timestamp is the arrival of the packet
 * with its last byte, as the kernel timestamps neither USB packets nor serial bytes; rate_hz
 * is of all stations together.
 *
 * When the tracker is unplugged, silent for silent_ms, or sends no valid record for as
 * long, the thread tries every retry_ms to open it and to set it up again. Until then
 * read() returns 0, and the missing samples count as lost. After gone_ms read() returns
 * -ENODEV for good.
 */
#ifndef INCISE_POLHEMUS_TRACKER_H
#define INCISE_POLHEMUS_TRACKER_H

#include <incise/backend.h>
#include "polhemus_line.h"

struct polhemus_times {
	int silent_ms, retry_ms, gone_ms;
};

/* Times of a rig; tests use shorter ones. */
#define POLHEMUS_TIMES ((struct polhemus_times){1000, 250, 10000})

/*
 * Set it up and start. The tracker owns the line, also when this fails. NULL with errno
 * as of polhemus_setup(), or ENOMEM, EINVAL (@setup).
 */
struct incise_tracker *polhemus_tracker_open(struct polhemus_line *line,
					     const struct incise_tracker_setup *setup,
					     const struct polhemus_times *times,
					     const char *where, struct incise_error *err);

#endif
