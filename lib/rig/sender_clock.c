// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Timestamps of a sender; see sender_clock.h.
 */
#include "sender_clock.h"

#define WINDOW_NS INT64_C(5000000000)
#define DELAY_MAX_NS INT64_C(1000000000) /* more is another clock, not a delay */

/* The clock of the sender was set, or it is the first timestamp. */
static void map_anew(struct incise_sender_clock *clock, int64_t t_ns, int64_t offset_ns)
{
	clock->is_mapped = true;
	clock->window_ns = t_ns;
	clock->least_ns[0] = clock->least_ns[1] = offset_ns;
}

/* Wall clocks of 1970 to 2106 and a monotonic one: no difference overflows. */
int64_t incise_sender_time(struct incise_sender_clock *clock, int64_t stamp_ns,
			   int64_t t_ns)
{
	int64_t offset_ns = t_ns - stamp_ns, least_ns;

	if (!clock->is_mapped || stamp_ns < clock->stamp_ns)
		map_anew(clock, t_ns, offset_ns);
	clock->stamp_ns = stamp_ns;
	if (t_ns - clock->window_ns > WINDOW_NS) {
		clock->window_ns = t_ns;
		clock->least_ns[1] = clock->least_ns[0];
		clock->least_ns[0] = offset_ns;
	}
	if (offset_ns < clock->least_ns[0])
		clock->least_ns[0] = offset_ns;
	least_ns = clock->least_ns[1] < clock->least_ns[0] ? clock->least_ns[1]
							   : clock->least_ns[0];
	if (offset_ns - least_ns <= DELAY_MAX_NS)
		return stamp_ns + least_ns;
	map_anew(clock, t_ns, offset_ns);
	return t_ns;
}
