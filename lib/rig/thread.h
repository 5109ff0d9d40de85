/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A thread of a device: real-time where this program may, and without the program's
 * signals.
 */
#ifndef INCISE_DEVICE_THREAD_H
#define INCISE_DEVICE_THREAD_H

#include <pthread.h>
#include <stdbool.h>

/* Above a haptic loop at 80, which must not delay the motor. */
#define INCISE_THREAD_PRIORITY 85

/* 0 or a negative errno. @real_time: whether it got SCHED_FIFO; NULL: it needs no real time. */
int incise_thread_start(pthread_t *thread, void *(*run)(void *), void *argument,
			bool *real_time);

/*
 * Lower the calling thread to normal priority, or restore it: a search for a device takes
 * milliseconds of a processor, which a loop may need.
 */
void incise_thread_hurry(bool hurry);

#endif
