// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The pump's disk: pictures into the file, and a record of each; see frame_pump_threads.h.
 */
#include <errno.h>
#include <math.h>
#include "frame_pump_threads.h"

static void put(struct incise_frame_pump *p, const struct incise_frame_slot *slot)
{
	struct incise_frames_stored stored;
	struct incise_error err = {0};
	struct frame_written written;
	int rc;

	if (frame_pump_is(&p->file_failed) || frame_pump_is(&p->give_up)) {
		frame_pump_count(&p->unwritten);
		return;
	}
	rc = incise_frames_put(p->setup.writer, &slot->frame, &stored, &err);
	if (rc) {
		frame_pump_count(&p->unwritten);
		/* EINVAL: a picture that is not as the camera said; the next may be. */
		if (rc == -EINVAL)
			return;
		p->file_error = err;
		frame_pump_say(&p->file_failed);
		return;
	}
	written = (struct frame_written){
		.order = slot->order,
		.looked_at = slot->looked_at,
		.record =
			{
				.seq = slot->frame.seq,
				.t_ns = slot->frame.t_ns,
				.arrival_ns = slot->arrival_ns,
				.pts_ms = stored.pts_ms,
				.bytes = stored.bytes,
				.crc = stored.crc,
				.length_px = NAN,
				.sd_px = NAN,
				.depth_mm = NAN,
				.quality = NAN,
			},
	};
	frame_pump_count(&p->written);
	atomic_fetch_add_explicit(&p->bytes, stored.bytes, memory_order_relaxed);
	if (!incise_ring_put(&p->records, &written))
		frame_pump_count(&p->unrecorded);
}

void *incise_frame_pump_file(void *pump)
{
	struct incise_frame_pump *p = pump;
	const struct incise_frame_slot *slot;
	struct incise_error err = {0};
	int rc;

	for (;;) {
		/* Read before looking: what was put before it is seen. */
		bool last = frame_pump_is(&p->drain);

		while ((slot = incise_frame_slots_oldest(&p->slots))) {
			put(p, slot);
			incise_frame_slots_drop(&p->slots);
		}
		if (last)
			break;
		while (sem_wait(&p->filled))
			;
	}
	rc = incise_frames_writer_close(p->setup.writer, &err);
	if (rc && !frame_pump_is(&p->file_failed)) {
		p->file_error = err;
		frame_pump_say(&p->file_failed);
	}
	sem_post(&p->ended);
	return NULL;
}
