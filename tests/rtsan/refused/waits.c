// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What the compiler must refuse, else it proves nothing of the library: a function that is
 * said to be real-time safe, and takes memory two calls further, on a way that is never
 * gone.
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
