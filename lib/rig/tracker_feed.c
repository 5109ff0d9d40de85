// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The reader's side of a tracker with a thread; see tracker_feed.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "tracker_feed.h"

INCISE_REALTIME int tracker_feed_read(struct incise_tracker *tracker,
				      struct incise_tracker_sample *samples, int n)
{
	struct tracker_feed *feed = (struct tracker_feed *)tracker;
	/* Read ahead of the ring, which has the samples from before the end. */
	int gone = atomic_load(&feed->gone);
	int taken = incise_ring_take(feed->ring, samples, n);

	return taken || n <= 0 ? taken : gone;
}

int tracker_feed_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	const struct tracker_feed *feed = (struct tracker_feed *)tracker;

	return snprintf(text, size, "%s",
			atomic_load(&feed->gone) ? feed->cause.text : "");
}

void tracker_feed_end(struct tracker_feed *feed, const char *fmt, ...)
{
	char text[sizeof(feed->cause.text)];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	incise_error_set(&feed->cause, ENODEV, "%s", text);
	atomic_store(&feed->gone, -ENODEV);
}

bool tracker_repeats(struct tracker_repeat *repeat, const double *pose, size_t n,
		     int64_t t_ns, double most_ms)
{
	if (!repeat->started || memcmp(pose, repeat->pose, n * sizeof(*pose))) {
		memcpy(repeat->pose, pose, n * sizeof(*pose));
		repeat->since_ns = t_ns;
		repeat->started = true;
	}
	return most_ms > 0 && (double)(t_ns - repeat->since_ns) > most_ms * 1e6;
}
