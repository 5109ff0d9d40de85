/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Clocks. Every device, recording and loop takes its time from a clock, so that the same code
 * runs in real time and, on the simulated rig, in simulated time as fast as possible.
 *
 *   real:       now() = CLOCK_MONOTONIC        wait_until(t) sleeps
 *   simulated:  now() = end of the last wait   wait_until(t) sets the time to t
 *   paced:      the same                       wait_until(t) sleeps first
 */
#ifndef INCISE_CLOCK_H
#define INCISE_CLOCK_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Nanoseconds in a second. */
#define INCISE_NS_PER_S 1000000000LL

struct incise_clock;

/**
 * A clock that reads CLOCK_MONOTONIC.
 *
 * @return clock, to be freed with incise_clock_free(); NULL with errno ENOMEM.
 */
INCISE_API struct incise_clock *incise_clock_new_real(void);

/**
 * A clock that advances only when a program waits for it.
 *
 * @param start_ns the first value of incise_clock_now(), ns
 * @return clock, to be freed with incise_clock_free(); NULL with errno ENOMEM.
 */
INCISE_API struct incise_clock *incise_clock_new_simulated(int64_t start_ns);

/**
 * A simulated clock whose waits take real time: it advances by the same steps as a simulated
 * clock, but no faster than CLOCK_MONOTONIC from the first wait on. After a wait that took too
 * long, the next waits are shorter until the clock has caught up.
 *
 * @param start_ns as above
 * @return clock, to be freed with incise_clock_free(); NULL with errno ENOMEM.
 */
INCISE_API struct incise_clock *incise_clock_new_paced(int64_t start_ns);

/** NULL is accepted. */
INCISE_API void incise_clock_free(struct incise_clock *clock);

/** Nanoseconds since an arbitrary start. Real-time safe (vDSO). */
INCISE_API int64_t incise_clock_now(const struct incise_clock *clock) INCISE_REALTIME;

/** True if time passes by itself. Real-time safe. */
INCISE_API bool incise_clock_is_real(const struct incise_clock *clock) INCISE_REALTIME;

/**
 * Delay of a paced clock behind CLOCK_MONOTONIC at the end of its last wait, ns; 0 for other
 * clocks. Real-time safe.
 */
INCISE_API int64_t incise_clock_lag_ns(const struct incise_clock *clock) INCISE_REALTIME;

/**
 * Wait until an absolute time; if it has passed, return at once.
 *
 * @return 0, or -EINTR when a signal handler ran. Makes one system call on a real or paced
 *         clock; an interrupted paced clock does not advance.
 */
INCISE_API int incise_clock_wait_until(struct incise_clock *clock, int64_t t_ns);

INCISE_END_DECLS
#endif
