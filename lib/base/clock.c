// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Real and simulated time; see incise/clock.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <time.h>
#include <incise/clock.h>
#include "monotonic.h"

struct incise_clock {
	bool real;
	int64_t now_ns; /* of a simulated clock */
};

static struct incise_clock *clock_new(bool real, int64_t start_ns)
{
	struct incise_clock *clock = malloc(sizeof(*clock));

	if (clock)
		*clock = (struct incise_clock){.real = real, .now_ns = start_ns};
	return clock;
}

struct incise_clock *incise_clock_new_real(void)
{
	return clock_new(true, 0);
}

struct incise_clock *incise_clock_new_simulated(int64_t start_ns)
{
	return clock_new(false, start_ns);
}

void incise_clock_free(struct incise_clock *clock)
{
	free(clock);
}

int64_t incise_clock_now(const struct incise_clock *clock)
{
	if (!clock->real)
		return clock->now_ns;
	return incise_monotonic_ns();
}

bool incise_clock_is_real(const struct incise_clock *clock)
{
	return clock->real;
}

int incise_clock_wait_until(struct incise_clock *clock, int64_t t_ns)
{
	struct timespec ts = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	if (!clock->real) {
		if (t_ns > clock->now_ns)
			clock->now_ns = t_ns;
		return 0;
	}
	if (t_ns <= 0)
		return 0;
	return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, NULL);
}
