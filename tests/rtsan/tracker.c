// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Poses of a Polhemus tracker, taken as a tick does while its own thread reads a line: also
 * while the line is pulled out, and when it is gone for good.
 */
#include <errno.h>
#include "../../lib/device/polhemus/polhemus_tracker.h"
#include "../../lib/device/polhemus/polhemus_tty.h"
#include "../unit/polhemus/pty.h"

#define PATIENCE_NS INT64_C(60000000000)

static const struct incise_tracker_setup setup = {
	.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};
/* Given up after half a second. */
static const struct polhemus_times times = {150, 20, 500};

/* As the first stage of a plan does. */
static INCISE_REALTIME int take(struct incise_tracker *tracker,
				struct incise_tracker_sample *samples, int n)
{
	return incise_tracker_read(tracker, samples, n);
}

static void fail(const char *what)
{
	fprintf(stderr, "FAIL  rtsan: tracker: %s\n", what);
	exit(1);
}

/* Read until @n came, or an error. */
static int take_some(struct incise_tracker *tracker, int n)
{
	int64_t end_ns = now_ns() + PATIENCE_NS;

	while (n > 0) {
		struct incise_tracker_sample samples[16];
		int m = take(tracker, samples, 16);

		if (m < 0)
			return m;
		n -= m;
		if (now_ns() > end_ns)
			fail("nothing came");
		usleep(1000);
	}
	return 0;
}

int main(void)
{
	static struct pty pty;
	struct incise_error err = {0};
	struct incise_tracker *tracker;
	struct polhemus_line *line;

	if (pty_begin(&pty, EMULATOR_FASTRAK))
		fail("no pseudo terminal");
	line = polhemus_tty_open(pty.path, "rig.conf:1: tracker", &err);
	tracker = line ? polhemus_tracker_open(line, &setup, &times,
					       "rig.conf:1: tracker", &err)
		       : NULL;
	if (!tracker)
		fail(err.text);
	if (take_some(tracker, 30))
		fail("it went away by itself");
	pty_unplug(&pty);
	if (take_some(tracker, 1000000) != -ENODEV)
		fail("it was not given up");
	tracker->ops->close(tracker);
	pty_end(&pty);
	puts("ok    rtsan: poses of a tracker at a line, unplugged and given up");
	return 0;
}
