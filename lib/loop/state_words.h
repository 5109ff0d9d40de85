/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Words that one thread writes while others read them, without a lock.
 *
 *   writer   seq odd ── words ── seq even         one at a time per part
 *   reader   seq even ── copy ── the same seq     else once more
 *
 * Every word is written as an atomic, so that a race is a torn copy that seq gives away, and
 * never undefined. The pattern is H.-J. Boehm's, 'Can seqlocks get along with programming
 * language memory models?', MSPC 2012, figure 6; as in device/page.c.
 */
#ifndef INCISE_STATE_WORDS_H
#define INCISE_STATE_WORDS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

_Static_assert(__atomic_always_lock_free(sizeof(uint64_t), 0), "words of 8 bytes");

/* Inlined: with its size known a copy is a line of moves. */
#define STATE_INLINE static inline __attribute__((always_inline))

STATE_INLINE void state_put(void *to, const void *from, size_t size)
{
	uint64_t *words = to, word;

	for (size_t i = 0; i < size / sizeof(word); i++) {
		memcpy(&word, (const char *)from + i * sizeof(word), sizeof(word));
		__atomic_store_n(words + i, word, __ATOMIC_RELAXED);
	}
}

/* The counter of one writer: no locked operation is needed. */
STATE_INLINE void state_count(uint64_t *counter)
{
	__atomic_store_n(counter, __atomic_load_n(counter, __ATOMIC_RELAXED) + 1,
			 __ATOMIC_RELAXED);
}

/* A part of which seq is the first word, from a copy of which it is not used. */
STATE_INLINE void state_publish(void *part, const void *from, size_t size)
{
	uint64_t *seq = part;
	uint64_t even = __atomic_load_n(seq, __ATOMIC_RELAXED) & ~(uint64_t)1;

	__atomic_store_n(seq, even + 1, __ATOMIC_RELAXED);
	__atomic_thread_fence(__ATOMIC_RELEASE);
	state_put(seq + 1, (const char *)from + sizeof(*seq), size - sizeof(*seq));
	__atomic_store_n(seq, even + 2, __ATOMIC_RELEASE);
}

#endif
