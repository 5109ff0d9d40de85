// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The pump's eye: where the scalpel is in each picture, and whose record that belongs to; see
 * frame_pump_threads.h.
 */
#include <math.h>
#include "frame_pump_threads.h"

void *incise_frame_pump_vision(void *pump)
{
	struct incise_frame_pump *p = pump;
	const struct incise_frame_slot *slot;

	for (;;) {
		bool last = frame_pump_is(&p->drain);

		while ((slot = incise_frame_slots_oldest(&p->vision_slots))) {
			struct incise_vision_result seen = {0};
			struct frame_looked looked = {slot->order, NAN, NAN, NAN, 0};

			if (!incise_vision_measure(p->setup.vision, &slot->frame,
						   &seen) &&
			    seen.found)
				looked =
					(struct frame_looked){slot->order, seen.length_px,
							      seen.sd_px, seen.depth_mm,
							      seen.quality};
			incise_ring_put(&p->results, &looked);
			incise_frame_slots_drop(&p->vision_slots);
		}
		if (last)
			return NULL;
		while (sem_wait(&p->vision_filled))
			;
	}
}

/*
 * Join what was seen to a record. False: it is not known yet. Both rings are in order, and
 * what has no partner (a picture that was not written) is passed over.
 */
static bool join(struct incise_frame_pump *p, struct frame_written *written)
{
	if (!written->looked_at)
		return true;
	while (!p->has_result || p->result.order < written->order) {
		p->has_result = incise_ring_take(&p->results, &p->result, 1) == 1;
		if (!p->has_result)
			return p->stopped;
	}
	if (p->result.order != written->order)
		return true;
	p->has_result = false;
	written->record.length_px = p->result.length_px;
	written->record.sd_px = p->result.sd_px;
	written->record.depth_mm = p->result.depth_mm;
	written->record.quality = p->result.quality;
	return true;
}

int incise_frame_pump_take(struct incise_frame_pump *pump,
			   struct incise_frame_record *records, int n)
{
	int taken = 0;

	while (taken < n) {
		if (!pump->has_next)
			pump->has_next =
				incise_ring_take(&pump->records, &pump->next, 1) == 1;
		if (!pump->has_next || !join(pump, &pump->next))
			break;
		pump->has_next = false;
		records[taken++] = pump->next.record;
	}
	return taken;
}
