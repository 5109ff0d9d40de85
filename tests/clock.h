/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The time of programs and tests that watch a machine: CLOCK_MONOTONIC. */
#ifndef TEST_CLOCK_H
#define TEST_CLOCK_H

#include <stdint.h>
#include <time.h>

__attribute__((unused)) static int64_t now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

#endif
