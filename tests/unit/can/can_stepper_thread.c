// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_stepper.c with its real thread, on the simulated drive's clock: that
 * goes on when both threads sleep, to the time for which the first of them waits. So the order is
 * the same every time, and no time of the computer counts.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <pthread.h>
#include <time.h>
#include "rig.h"

static struct can_rig rig;

/* The test's own thread, and the stepper's. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t woken = PTHREAD_COND_INITIALIZER;
static struct {
	bool lives, sleeps;
	int64_t until_ns;
} threads[2] = {{.lives = true}};
static _Thread_local int self;
static void *(*thread_run)(void *argument);

/* If all sleep, let time go on, and wake those who waited for that. */
static void advance(void)
{
	int64_t next = INT64_MAX;

	for (int i = 0; i < 2; i++) {
		if (threads[i].lives && !threads[i].sleeps)
			return;
		if (threads[i].lives && threads[i].until_ns < next)
			next = threads[i].until_ns;
	}
	if (next == INT64_MAX)
		return;
	if (next > rig.drive.now_ns)
		drive_advance(&rig.drive, next - rig.drive.now_ns);
	for (int i = 0; i < 2; i++)
		threads[i].sleeps &= threads[i].until_ns > rig.drive.now_ns;
	pthread_cond_broadcast(&woken);
}

static void sleep_until(int64_t t_ns)
{
	pthread_mutex_lock(&lock);
	threads[self].sleeps = true;
	threads[self].until_ns = t_ns;
	advance();
	while (threads[self].sleeps)
		pthread_cond_wait(&woken, &lock);
	pthread_mutex_unlock(&lock);
}

int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *t,
			   struct timespec *left)
{
	assert_int_equal(flags, TIMER_ABSTIME);
	sleep_until(t->tv_sec * 1000000000LL + t->tv_nsec);
	return 0;
}

static void *start(void *argument)
{
	self = 1;
	thread_run(argument);
	pthread_mutex_lock(&lock);
	threads[1].lives = false;
	pthread_mutex_unlock(&lock);
	return NULL;
}

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attr,
			  void *(*run)(void *), void *argument);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr,
			  void *(*run)(void *), void *argument)
{
	thread_run = run;
	threads[1].lives = true;
	threads[1].sleeps = false;
	return __real_pthread_create(thread, attr, start, argument);
}

int __real_pthread_join(pthread_t thread, void **result);

/* Time goes on for the other one meanwhile. */
int __wrap_pthread_join(pthread_t thread, void **result)
{
	int rc;

	pthread_mutex_lock(&lock);
	threads[0].sleeps = true;
	threads[0].until_ns = INT64_MAX;
	advance();
	pthread_mutex_unlock(&lock);
	rc = __real_pthread_join(thread, result);
	threads[0].sleeps = false;
	return rc;
}

/* For a frame: it can only be sent in a tick of the drive. */
static int wait_frame(struct can_bus *bus, int64_t until_ns)
{
	struct drive *d = &rig.drive;

	while (d->now_ns < until_ns &&
	       !(d->queued && d->queue[d->head].at_ns <= d->now_ns))
		sleep_until(d->now_ns + DRIVE_TICK_NS);
	return 0;
}

static struct incise_stepper *open_stepper(struct incise_error *err)
{
	static const struct can_transport transport = {"can", can_rig_transport, NULL};
	static struct can_bus_ops ops;
	struct incise_backend_request request = {
		.arguments = rig.arguments,
		.where = "rig.conf:3: stepper",
		.watch = rig.watch,
		.actuator = &rig.actuator,
	};

	ops = *rig.drive.bus.ops;
	ops.wait = wait_frame;
	rig.drive.bus.ops = &ops;
	return rig.stepper = can_stepper_open(&transport, &request, err);
}

static void nap(int64_t ns)
{
	sleep_until(rig.drive.now_ns + ns);
}

static void it_runs_and_lends_the_bus(void **state)
{
	struct incise_stepper_status s = {0};
	struct incise_error err = {0};

	can_rig_init(&rig);
	if (!open_stepper(&err))
		fail_msg("%s", err.text);
	assert_int_equal(incise_stepper_enable(rig.stepper, &err), 0);
	/* 0.5 mm at 10 mm/s and 500 mm/s². */
	for (int i = 0; i < 50; i++) {
		assert_int_equal(incise_stepper_set(rig.stepper, 0.5), 0);
		nap(2 * DRIVE_MS);
	}
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	assert_true(fabs(s.position_mm - 0.5) < 1e-3);
	/* Borrowed again and again: disable, SDOs, enable. */
	for (int i = 0; i < 3; i++) {
		if (incise_stepper_disable(rig.stepper, &err) ||
		    incise_stepper_clear(rig.stepper, &err) ||
		    incise_stepper_enable(rig.stepper, &err))
			fail_msg("%s", err.text);
	}
	incise_stepper_set(rig.stepper, 15);
	nap(40 * DRIVE_MS);
	assert_true(rig.drive.velocity > 0);
	/* Closed under way. */
	rig.stepper->ops->close(rig.stepper);
	if (drive_powered(&rig.drive))
		fail_msg("left in %s", cia402_state_name(rig.drive.state));
	assert_int_equal(rig.drive.enabled_unasked, 0);
}

static void a_watcher_has_a_thread_too(void **state)
{
	struct incise_stepper_status s = {0};
	struct incise_error err = {0};
	int64_t t_ns;

	can_rig_init(&rig);
	rig.watch = true;
	if (!open_stepper(&err))
		fail_msg("%s", err.text);
	/* The first status is valid at once. */
	assert_int_equal(incise_stepper_status(rig.stepper, &s), 0);
	assert_true(s.t_ns && s.state == INCISE_STEPPER_STATE_DISABLED);
	t_ns = s.t_ns;
	nap(30 * DRIVE_MS);
	incise_stepper_status(rig.stepper, &s);
	assert_true(s.t_ns > t_ns);
	rig.stepper->ops->close(rig.stepper);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_runs_and_lends_the_bus),
		cmocka_unit_test(a_watcher_has_a_thread_too),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
