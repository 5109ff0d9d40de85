// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/thread.c: the thread runs with all signals blocked, and the caller's own mask
 * stays what it was.
 */
#include "../unit.h"
#include <signal.h>
#include "../../../lib/rig/thread.h"

static void *look(void *argument)
{
	pthread_sigmask(SIG_SETMASK, NULL, argument);
	return argument;
}

TEST(signals_are_the_programs)
{
	sigset_t within, before, after;
	bool real_time;
	pthread_t thread;
	void *result;

	sigemptyset(&within);
	pthread_sigmask(SIG_SETMASK, NULL, &before);
	assert_int_equal(incise_thread_start(&thread, look, &within, &real_time), 0);
	assert_int_equal(pthread_join(thread, &result), 0);
	assert_ptr_equal(result, &within);
	pthread_sigmask(SIG_SETMASK, NULL, &after);
	assert_true(sigismember(&within, SIGINT) && sigismember(&within, SIGTERM) &&
		    sigismember(&within, SIGUSR1));
	assert_int_equal(sigismember(&after, SIGINT), sigismember(&before, SIGINT));
	assert_int_equal(sigismember(&after, SIGTERM), sigismember(&before, SIGTERM));
}
