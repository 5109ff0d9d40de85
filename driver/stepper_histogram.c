// SPDX-License-Identifier: GPL-2.0-only
/*
 * Times in bins that double: [0, 1), [1, 2), [2, 4) … µs. Cheap enough for each
 * firing of a timer.
 */
#include <linux/bitops.h>
#include <linux/minmax.h>

#include "stepper.h"

void stepper_histogram_add(struct stepper_histogram *histogram, s64 ns)
{
	u64 value = ns > 0 ? ns : 0;
	/* 32 bits, so that the division is cheap everywhere. */
	u32 us = (u32)min_t(u64, value, U32_MAX) / 1000;

	histogram->count[min(fls(us), STEPPER_BINS - 1)]++;
	histogram->sum_ns += value;
	histogram->max_ns = max(histogram->max_ns, value);
}
