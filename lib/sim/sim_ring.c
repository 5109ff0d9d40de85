// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The ring between the virtual world and a device's reader; see world.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "world.h"

int incise_sim_ring_init(struct incise_sim_ring *ring, size_t size, double hz,
			 double extra_s)
{
	*ring = (struct incise_sim_ring){
		.size = size,
		.room = (size_t)ceil(hz * (INCISE_SIM_ROOM_S + extra_s)) + 1,
	};
	ring->records = calloc(ring->room, size);
	return ring->records ? 0 : -ENOMEM;
}

void incise_sim_ring_free(struct incise_sim_ring *ring)
{
	free(ring->records);
}

void incise_sim_ring_push(struct incise_sim_ring *ring, const void *record)
{
	size_t tail;

	if (ring->count == ring->room) {
		incise_sim_ring_pop(ring);
		ring->lost++;
	}
	tail = ring->head + ring->count++;
	if (tail >= ring->room)
		tail -= ring->room;
	memcpy(ring->records + tail * ring->size, record, ring->size);
}

const void *incise_sim_ring_peek(const struct incise_sim_ring *ring)
{
	return ring->count ? ring->records + ring->head * ring->size : NULL;
}

void incise_sim_ring_pop(struct incise_sim_ring *ring)
{
	if (++ring->head == ring->room)
		ring->head = 0;
	ring->count--;
}
