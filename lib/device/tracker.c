// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker, whatever stands behind it; see incise/tracker.h.
 */
#include <stdio.h>
#include <incise/backend.h>

int incise_tracker_read(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	return tracker->ops->read(tracker, samples, n);
}

void incise_tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	tracker->ops->info(tracker, info);
}

uint64_t incise_tracker_lost(const struct incise_tracker *tracker)
{
	return tracker->ops->lost(tracker);
}

int incise_tracker_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	return tracker->ops->cause ? tracker->ops->cause(tracker, text, size)
				   : snprintf(text, size, "%s", "");
}
