// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Real, simulated and paced time; see incise/clock.h.
 */
#include <stdlib.h>
#include <time.h>
#include <incise/clock.h>
#include "monotonic.h"

struct incise_clock {
	bool real, paced, started;
	int64_t now_ns; /* of one that is not real */
	int64_t ahead_ns; /* of a paced one that has started: CLOCK_MONOTONIC less its time */
	int64_t lag_ns;
};

static struct incise_clock *clock_new(bool real, bool paced, int64_t start_ns)
{
	struct incise_clock *clock = malloc(sizeof(*clock));

	if (clock)
		*clock = (struct incise_clock){
			.real = real, .paced = paced, .now_ns = start_ns};
	return clock;
}

struct incise_clock *incise_clock_new_real(void)
{
	return clock_new(true, false, 0);
}

struct incise_clock *incise_clock_new_simulated(int64_t start_ns)
{
	return clock_new(false, false, start_ns);
}

struct incise_clock *incise_clock_new_paced(int64_t start_ns)
{
	return clock_new(false, true, start_ns);
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

int64_t incise_clock_lag_ns(const struct incise_clock *clock)
{
	return clock->lag_ns;
}

static int sleep_until(int64_t t_ns)
{
	struct timespec ts = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	if (t_ns <= 0)
		return 0;
	return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, NULL);
}

/* Returns 0, or -EINTR with all as it was. */
static int keep_pace(struct incise_clock *clock, int64_t t_ns)
{
	int64_t due_ns;
	int rc;

	if (!clock->started)
		clock->ahead_ns = incise_monotonic_ns() - clock->now_ns;
	clock->started = true;
	due_ns = t_ns + clock->ahead_ns;
	rc = sleep_until(due_ns);
	if (!rc)
		clock->lag_ns = incise_monotonic_ns() - due_ns;
	return rc;
}

int incise_clock_wait_until(struct incise_clock *clock, int64_t t_ns)
{
	int rc = 0;

	if (clock->real)
		return sleep_until(t_ns);
	if (t_ns <= clock->now_ns)
		return 0;
	if (clock->paced)
		rc = keep_pace(clock, t_ns);
	if (!rc)
		clock->now_ns = t_ns;
	return rc;
}
