/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A ring between one thread that writes records and one that reads them; neither waits nor
 * makes a system call.
 *
 *   written: one thread        taken: another
 *        |                        |
 *        v  head                  v  tail          head - tail records wait
 *   [  ][r9][r8][r7][r6][  ][  ][  ]               full: the new one is dropped and counted
 *
 * All memory is there from the start. A full ring drops new records: only the reader may move
 * the tail.
 */
#ifndef INCISE_BASE_RING_H
#define INCISE_BASE_RING_H

#include <incise/export.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct incise_ring {
	size_t size;	   /* of a record, bytes */
	uint64_t capacity; /* records: a power of 2 */
	unsigned char *records;
	/* Far apart, so that the two threads do not fight for a line of the cache. */
	_Alignas(64) _Atomic uint64_t head;
	_Atomic uint64_t dropped;
	_Alignas(64) _Atomic uint64_t tail;
};

/* For at least @count records of @size bytes. 0, -ENOMEM, -EINVAL (nothing, or too much). */
int incise_ring_init(struct incise_ring *ring, size_t size, size_t count);
void incise_ring_free(struct incise_ring *ring);

/* For the writer: false, and one more dropped, when it is full. Real-time safe. */
bool incise_ring_put(struct incise_ring *ring, const void *record) INCISE_REALTIME;

/* For the reader: take at most @n, oldest first; returns their number. Real-time safe. */
int incise_ring_take(struct incise_ring *ring, void *records, int n) INCISE_REALTIME;

/* Records dropped so far; for any thread. */
uint64_t incise_ring_dropped(const struct incise_ring *ring);

#endif
