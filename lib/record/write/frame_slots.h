/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A ring of pictures between one thread that puts copies in and one that looks at the oldest
 * where it lies; as ../base/ring.h, but what is taken is not copied a second time.
 *
 *     put: one thread                 oldest, drop: another
 *        |  head                         |  tail
 *        v                               v
 *     [   ][ 9 ][ 8 ][ 7 ][   ][   ][   ]        full: the new one is refused
 *
 * All memory is taken at the start, and comes to be resident as slots are used for the first
 * time: of slots for the largest JPEG there may be, only what pictures fill.
 */
#ifndef INCISE_FRAME_SLOTS_H
#define INCISE_FRAME_SLOTS_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>

struct incise_frame_slot {
	struct incise_camera_frame frame; /* its data is the slot's */
	int64_t arrival_ns;
	uint64_t order; /* counts those accepted, from 0 */
	bool looked_at; /* vision has a copy */
};

struct incise_frame_slots {
	size_t size; /* of a picture, most bytes */
	uint64_t count;
	uint8_t *bytes;
	struct incise_frame_slot *slots;
	/* Far apart, so that the two threads do not fight for a line of the cache. */
	_Alignas(64) _Atomic uint64_t head;
	_Alignas(64) _Atomic uint64_t tail;
};

/* 0, -ENOMEM, -EINVAL (nothing, or too much). */
int incise_frame_slots_init(struct incise_frame_slots *slots, size_t size,
			    uint64_t count);
void incise_frame_slots_free(struct incise_frame_slots *slots);

/* The writer's: whether there is room. What there is stays until it is used. */
bool incise_frame_slots_room(const struct incise_frame_slots *slots);

/* The writer's: false when it is full, or the picture is larger than a slot. */
bool incise_frame_slots_put(struct incise_frame_slots *slots,
			    const struct incise_frame_slot *slot);

/* The reader's: the oldest, until it is dropped; NULL: none. */
const struct incise_frame_slot *incise_frame_slots_oldest(
	const struct incise_frame_slots *slots);
void incise_frame_slots_drop(struct incise_frame_slots *slots);

/* How many wait; any thread's. */
uint64_t incise_frame_slots_wait(const struct incise_frame_slots *slots);

#endif
