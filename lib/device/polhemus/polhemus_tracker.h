/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A tracker of Polhemus behind struct incise_tracker, whatever line leads to it.
 *
 * A thread of its own reads the line and puts samples into a ring; incise_tracker_read()
 * takes them out of it: real-time safe. A sample's stamp is when the packet with its last
 * byte had come, as the kernel stamps neither USB packets nor serial bytes; rate_hz is of all
 * stations together.
 *
 * Pulled out, or silent for silent_ms, or sending what is no record for as long, the tracker is looked for every retry_ms, set up again
 * and goes on; until then read() returns 0, and what the time in between would have brought
 * counts as lost, whether it comes back or not, from the start on. After gone_ms read()
 * returns -ENODEV, for good.
 */
#ifndef INCISE_POLHEMUS_TRACKER_H
#define INCISE_POLHEMUS_TRACKER_H

#include <incise/backend.h>
#include "polhemus_line.h"

struct polhemus_times {
	int silent_ms, retry_ms, gone_ms;
};

/* What a rig gets; tests are less patient. */
#define POLHEMUS_TIMES ((struct polhemus_times){1000, 250, 10000})

/*
 * Set it up and begin. The line is the tracker's from here on, also when this fails. NULL
 * with errno as of polhemus_setup(), or ENOMEM, EINVAL (@setup).
 */
struct incise_tracker *polhemus_tracker_open(struct polhemus_line *line,
					     const struct incise_tracker_setup *setup,
					     const struct polhemus_times *times,
					     const char *where, struct incise_error *err);

#endif
