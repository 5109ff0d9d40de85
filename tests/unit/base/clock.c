// SPDX-License-Identifier: GPL-2.0-or-later
/* Real and simulated clocks. */
#include "../unit.h"
#include <signal.h>
#include <sys/time.h>
#include <time.h>
#include <incise/clock.h>

TEST(test_simulated_time_stands_still)
{
	struct incise_clock *clock = incise_clock_new_simulated(5);

	assert_false(incise_clock_is_real(clock));
	assert_int_equal(incise_clock_now(clock), 5);
	assert_int_equal(incise_clock_wait_until(clock, 1000), 0);
	assert_int_equal(incise_clock_now(clock), 1000);
	/* Time does not go back. */
	assert_int_equal(incise_clock_wait_until(clock, 10), 0);
	assert_int_equal(incise_clock_now(clock), 1000);
	incise_clock_free(clock);
}

/* Its steps are those of a simulated one, and no wait ends before its time. */
TEST(test_paced_time_is_simulated_time_that_takes_time)
{
	struct incise_clock *clock = incise_clock_new_paced(5);
	struct timespec before, after;

	assert_false(incise_clock_is_real(clock));
	assert_int_equal(incise_clock_now(clock), 5);
	assert_int_equal(incise_clock_lag_ns(clock), 0);
	clock_gettime(CLOCK_MONOTONIC, &before);
	for (int i = 1; i <= 4; i++) {
		assert_int_equal(incise_clock_wait_until(clock, 5 + i * 1000000), 0);
		assert_int_equal(incise_clock_now(clock), 5 + i * 1000000);
		assert_true(incise_clock_lag_ns(clock) >= 0);
	}
	clock_gettime(CLOCK_MONOTONIC, &after);
	assert_true((after.tv_sec - before.tv_sec) * INCISE_NS_PER_S + after.tv_nsec -
			    before.tv_nsec >=
		    4000000);
	/* What is over takes no time, and time does not go back. */
	assert_int_equal(incise_clock_wait_until(clock, 10), 0);
	assert_int_equal(incise_clock_now(clock), 4000005);
	incise_clock_free(clock);
}

TEST(test_real_time_is_monotonic_clock)
{
	struct incise_clock *clock = incise_clock_new_real();
	struct timespec before, after;
	int64_t now;

	assert_true(incise_clock_is_real(clock));
	clock_gettime(CLOCK_MONOTONIC, &before);
	now = incise_clock_now(clock);
	clock_gettime(CLOCK_MONOTONIC, &after);
	assert_true(now >= before.tv_sec * INCISE_NS_PER_S + before.tv_nsec);
	assert_true(now <= after.tv_sec * INCISE_NS_PER_S + after.tv_nsec);
	/* Waiting ends at the time or later, never before; the past does not wait. */
	assert_int_equal(incise_clock_wait_until(clock, now + 2000000), 0);
	assert_true(incise_clock_now(clock) >= now + 2000000);
	assert_int_equal(incise_clock_wait_until(clock, now), 0);
	assert_int_equal(incise_clock_wait_until(clock, -5), 0);
	incise_clock_free(clock);
}

static void on_alarm(int number)
{
}

TEST(test_a_signal_ends_the_wait)
{
	struct incise_clock *clock = incise_clock_new_real();
	/* Again every 5 ms, should the first one come before the wait has begun. */
	struct itimerval soon = {{0, 5000}, {0, 5000}}, never = {{0, 0}, {0, 0}};
	struct sigaction action = {.sa_handler = on_alarm};

	sigaction(SIGALRM, &action, NULL);
	setitimer(ITIMER_REAL, &soon, NULL);
	assert_int_equal(incise_clock_wait_until(clock, incise_clock_now(clock) +
								3600 * INCISE_NS_PER_S),
			 -EINTR);
	setitimer(ITIMER_REAL, &never, NULL);
	incise_clock_free(clock);
}
