/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A thread of a device that is to be on time: real-time where this program may, and not held
 * up by signals, which are the program's.
 */
#ifndef INCISE_DEVICE_THREAD_H
#define INCISE_DEVICE_THREAD_H

#include <pthread.h>
#include <stdbool.h>

/* Above a haptic loop at 80, which must not hold up what makes it move. */
#define INCISE_THREAD_PRIORITY 85

/* 0 or a negative errno. @real_time: whether it got SCHED_FIFO; NULL: it needs none. */
int incise_thread_start(pthread_t *thread, void *(*run)(void *), void *argument,
			bool *real_time);

/*
 * The calling thread is in no hurry, or again in as much as it was at its start: a search for
 * a device takes milliseconds of a processor, which a loop may need.
 */
void incise_thread_hurry(bool hurry);

#endif
