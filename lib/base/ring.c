// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A ring between one thread that writes and one that reads; see ring.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "ring.h"

#define COUNT_MAX ((size_t)1 << 30)

int incise_ring_init(struct incise_ring *ring, size_t size, size_t count)
{
	uint64_t capacity = 1;

	memset(ring, 0, sizeof(*ring));
	if (!size || !count || count > COUNT_MAX)
		return -EINVAL;
	while (capacity < count)
		capacity *= 2;
	if (size > SIZE_MAX / capacity)
		return -ENOMEM;
	ring->size = size;
	ring->capacity = capacity;
	ring->records = calloc(capacity, size);
	return ring->records ? 0 : -ENOMEM;
}

void incise_ring_free(struct incise_ring *ring)
{
	free(ring->records);
	ring->records = NULL;
}

bool incise_ring_put(struct incise_ring *ring, const void *record)
{
	uint64_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
	uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);

	if (head - tail == ring->capacity) {
		atomic_fetch_add_explicit(&ring->dropped, 1, memory_order_relaxed);
		return false;
	}
	memcpy(ring->records + (head & (ring->capacity - 1)) * ring->size, record,
	       ring->size);
	atomic_store_explicit(&ring->head, head + 1, memory_order_release);
	return true;
}

int incise_ring_take(struct incise_ring *ring, void *records, int n)
{
	uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
	uint64_t head = atomic_load_explicit(&ring->head, memory_order_acquire);
	int taken = 0;

	for (; taken < n && tail != head; taken++, tail++)
		memcpy((unsigned char *)records + (size_t)taken * ring->size,
		       ring->records + (tail & (ring->capacity - 1)) * ring->size,
		       ring->size);
	atomic_store_explicit(&ring->tail, tail, memory_order_release);
	return taken;
}

uint64_t incise_ring_dropped(const struct incise_ring *ring)
{
	return atomic_load_explicit(&ring->dropped, memory_order_relaxed);
}
