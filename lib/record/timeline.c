// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Times of acquisition; see timeline.h.
 */
#include "timeline.h"

void incise_timeline_init(struct incise_timeline *timeline, int64_t latency_ns)
{
	/* Times in a recording are never negative; see incise-recording(5). */
	*timeline = (struct incise_timeline){.latency_ns = latency_ns, .last_ns = -1};
}

int64_t incise_timeline_acquired(struct incise_timeline *timeline, int64_t arrival_ns)
{
	int64_t t_ns = arrival_ns - timeline->latency_ns;

	if (t_ns <= timeline->last_ns)
		t_ns = timeline->last_ns + 1;
	timeline->last_ns = t_ns;
	return t_ns;
}
