// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A ring of pictures between two threads; see frame_slots.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "frame_slots.h"

#define COUNT_MAX (1 << 20)

int incise_frame_slots_init(struct incise_frame_slots *slots, size_t size, uint64_t count)
{
	memset(slots, 0, sizeof(*slots));
	if (!size || !count || count > COUNT_MAX)
		return -EINVAL;
	slots->size = size;
	slots->count = count;
	slots->bytes = calloc(count, size);
	slots->slots = calloc(count, sizeof(*slots->slots));
	if (slots->bytes && slots->slots)
		return 0;
	incise_frame_slots_free(slots);
	return -ENOMEM;
}

void incise_frame_slots_free(struct incise_frame_slots *slots)
{
	free(slots->bytes);
	free(slots->slots);
	slots->bytes = NULL;
	slots->slots = NULL;
}

uint64_t incise_frame_slots_wait(const struct incise_frame_slots *slots)
{
	/* The tail first: read behind it, the head is no less. */
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_acquire);

	return atomic_load_explicit(&slots->head, memory_order_acquire) - tail;
}

bool incise_frame_slots_room(const struct incise_frame_slots *slots)
{
	return incise_frame_slots_wait(slots) < slots->count;
}

bool incise_frame_slots_put(struct incise_frame_slots *slots,
			    const struct incise_frame_slot *slot)
{
	uint64_t head = atomic_load_explicit(&slots->head, memory_order_relaxed);
	struct incise_frame_slot *to = &slots->slots[head % slots->count];
	uint8_t *bytes = slots->bytes + head % slots->count * slots->size;

	if (!incise_frame_slots_room(slots) || slot->frame.size > slots->size)
		return false;
	*to = *slot;
	memcpy(bytes, slot->frame.data, slot->frame.size);
	to->frame.data = bytes;
	atomic_store_explicit(&slots->head, head + 1, memory_order_release);
	return true;
}

const struct incise_frame_slot *incise_frame_slots_oldest(
	const struct incise_frame_slots *slots)
{
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_relaxed);

	if (atomic_load_explicit(&slots->head, memory_order_acquire) == tail)
		return NULL;
	return &slots->slots[tail % slots->count];
}

void incise_frame_slots_drop(struct incise_frame_slots *slots)
{
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_relaxed);

	atomic_store_explicit(&slots->tail, tail + 1, memory_order_release);
}
