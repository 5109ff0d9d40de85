// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The square root, by Heron's steps from above; see arithmetic.h.
 */
#include "arithmetic.h"

uint32_t incise_fx_root(uint64_t v)
{
	uint64_t x, next;
	int half;

	if (!v)
		return 0;
	half = (63 - __builtin_clzll((unsigned long long)v)) / 2;
	/* The mean of 2^half and v / 2^half: not below the root, and at most a quarter above it. */
	x = (((uint64_t)1 << half) + (v >> half)) / 2 + 1;
	/* Then a 40th, a 3200th, 2^-24, 2^-48 above it: a sixth step goes no lower. */
	for (int k = 0; k < 6; k++) {
		next = (x + div64_u64(v, x)) / 2;
		if (next >= x)
			break;
		x = next;
	}
	return (uint32_t)x;
}
