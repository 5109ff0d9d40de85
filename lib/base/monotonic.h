/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The time of all timestamps: CLOCK_MONOTONIC, in ns. Real-time safe (vDSO). Code that
 * follows a rig's clock, which may be simulated, calls incise_clock_now().
 */
#ifndef INCISE_BASE_MONOTONIC_H
#define INCISE_BASE_MONOTONIC_H

#include <stddef.h>
#include <stdint.h>
#include <time.h>
#include <incise/export.h>

/* The one call to the C library's side of the kernel that a tick makes: it stays outside. */
#if defined(__clang__) && defined(__has_warning)
#if __has_warning("-Wfunction-effects")
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wfunction-effects"
#define INCISE_MONOTONIC_POP
#endif
#endif

static INCISE_REALTIME inline int64_t incise_read_clock_ns(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

static INCISE_REALTIME inline int64_t incise_monotonic_ns(void)
{
	return incise_read_clock_ns(CLOCK_MONOTONIC);
}

/* A signal may end the sleep early. */
static inline void incise_monotonic_sleep_until(int64_t t_ns)
{
	struct timespec until = {t_ns / INT64_C(1000000000), t_ns % INT64_C(1000000000)};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

#ifdef INCISE_MONOTONIC_POP
#pragma clang diagnostic pop
#undef INCISE_MONOTONIC_POP
#endif

#endif
