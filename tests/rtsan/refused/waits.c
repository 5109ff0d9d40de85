// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Code that the compiler must refuse, to show that its check works: a function declared
 * real-time safe that allocates memory two calls further, on a path that is never taken.
 */
#include <stdlib.h>
#include <incise/clock.h>

static void *grow(size_t size)
{
	return malloc(size);
}

INCISE_REALTIME int64_t incise_clock_now(const struct incise_clock *clock)
{
	return clock ? 0 : (int64_t)(intptr_t)grow(1);
}
