/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A clock for a test and the one thread that it starts: it stands while one of them runs, and one
 * runs at a time. When both sleep, it goes on to the time for which the first of them waits, the
 * started thread before the test's own. So the order is the same every time, on any machine.
 *
 *   virtual_time_start(now_ns, advance);   advance(), or NULL, is told of each step of the clock
 *   thing_open();                          its thread sleeps at first
 *   virtual_sleep_until(t_ns);             now it runs
 *
 * For one .c file of a program, with all that it is linked to.
 */
#ifndef INCISE_TEST_VIRTUAL_TIME_H
#define INCISE_TEST_VIRTUAL_TIME_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <time.h>

static struct {
	pthread_mutex_t lock;
	pthread_cond_t woken;
	int64_t now_ns;
	void (*advance)(int64_t now_ns);
	struct {
		bool lives, sleeps;
		int64_t until_ns;
	} thread[2]; /* the test's own, and the other one */
	void *(*run)(void *argument);
} virtual_time = {
	.lock = PTHREAD_MUTEX_INITIALIZER,
	.woken = PTHREAD_COND_INITIALIZER,
	.thread[0].lives = true,
};
static _Thread_local int virtual_self;

static inline void virtual_time_start(int64_t now_ns, void (*advance)(int64_t now_ns))
{
	virtual_time.now_ns = now_ns;
	virtual_time.advance = advance;
}

/* Wake the first of those who sleep, if nobody runs. */
static inline void virtual_wake(void)
{
	int first = -1;

	for (int i = 1; i >= 0; i--) {
		if (!virtual_time.thread[i].lives)
			continue;
		if (!virtual_time.thread[i].sleeps)
			return;
		if (first < 0 ||
		    virtual_time.thread[i].until_ns < virtual_time.thread[first].until_ns)
			first = i;
	}
	if (virtual_time.thread[first].until_ns > virtual_time.now_ns) {
		virtual_time.now_ns = virtual_time.thread[first].until_ns;
		if (virtual_time.advance)
			virtual_time.advance(virtual_time.now_ns);
	}
	virtual_time.thread[first].sleeps = false;
	pthread_cond_broadcast(&virtual_time.woken);
}

static inline void virtual_sleep_until(int64_t t_ns)
{
	pthread_mutex_lock(&virtual_time.lock);
	virtual_time.thread[virtual_self].sleeps = true;
	virtual_time.thread[virtual_self].until_ns = t_ns;
	virtual_wake();
	while (virtual_time.thread[virtual_self].sleeps)
		pthread_cond_wait(&virtual_time.woken, &virtual_time.lock);
	pthread_mutex_unlock(&virtual_time.lock);
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
	*t = (struct timespec){virtual_time.now_ns / 1000000000,
			       virtual_time.now_ns % 1000000000};
	return 0;
}

int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *t,
			   struct timespec *left)
{
	int64_t ns = t->tv_sec * INT64_C(1000000000) + t->tv_nsec;

	virtual_sleep_until(flags & TIMER_ABSTIME ? ns : virtual_time.now_ns + ns);
	return 0;
}

int __wrap_nanosleep(const struct timespec *t, struct timespec *left)
{
	return __wrap_clock_nanosleep(CLOCK_MONOTONIC, 0, t, left);
}

static inline void *virtual_run(void *argument)
{
	virtual_self = 1;
	pthread_mutex_lock(&virtual_time.lock);
	while (virtual_time.thread[1].sleeps)
		pthread_cond_wait(&virtual_time.woken, &virtual_time.lock);
	pthread_mutex_unlock(&virtual_time.lock);
	virtual_time.run(argument);
	pthread_mutex_lock(&virtual_time.lock);
	virtual_time.thread[1].lives = false;
	if (virtual_time.thread[0].until_ns != INT64_MAX)
		virtual_wake();
	pthread_mutex_unlock(&virtual_time.lock);
	return NULL;
}

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attr,
			  void *(*run)(void *), void *argument);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr,
			  void *(*run)(void *), void *argument)
{
	virtual_time.run = run;
	virtual_time.thread[1].lives = virtual_time.thread[1].sleeps = true;
	virtual_time.thread[1].until_ns = virtual_time.now_ns;
	return __real_pthread_create(thread, attr, virtual_run, argument);
}

int __real_pthread_join(pthread_t thread, void **result);

/* The other one runs to its end. */
int __wrap_pthread_join(pthread_t thread, void **result)
{
	int rc;

	pthread_mutex_lock(&virtual_time.lock);
	virtual_time.thread[0].sleeps = true;
	virtual_time.thread[0].until_ns = INT64_MAX;
	if (virtual_time.thread[1].lives)
		virtual_wake();
	pthread_mutex_unlock(&virtual_time.lock);
	rc = __real_pthread_join(thread, result);
	virtual_time.thread[0].sleeps = false;
	return rc;
}

#endif
