// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A real-time thread of a device; see thread.h.
 */
#include <sched.h>
#include <signal.h>
#include "thread.h"

int incise_thread_start(pthread_t *thread, void *(*run)(void *), void *argument,
			bool *real_time)
{
	struct sched_param priority = {.sched_priority = INCISE_THREAD_PRIORITY};
	sigset_t all, before;
	int rc;

	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(thread, NULL, run, argument);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	if (rc)
		return -rc;
	if (real_time)
		*real_time = !pthread_setschedparam(*thread, SCHED_FIFO, &priority);
	return 0;
}

void incise_thread_hurry(bool hurry)
{
	struct sched_param priority = {.sched_priority =
					       hurry ? INCISE_THREAD_PRIORITY : 0};

	/* An error at the start as well: without real time there is no policy to restore. */
	pthread_setschedparam(pthread_self(), hurry ? SCHED_FIFO : SCHED_OTHER,
			      &priority);
}
