// SPDX-License-Identifier: GPL-2.0-only
/* 6.13: the callback is an argument; hrtimer_init() is gone in 6.15. */
#include <linux/hrtimer.h>

void probe(struct hrtimer *timer, enum hrtimer_restart (*tick)(struct hrtimer *));

void probe(struct hrtimer *timer, enum hrtimer_restart (*tick)(struct hrtimer *))
{
#ifdef NEW
	hrtimer_setup(timer, tick, CLOCK_MONOTONIC, HRTIMER_MODE_ABS_PINNED_HARD);
#else
	hrtimer_init(timer, CLOCK_MONOTONIC, HRTIMER_MODE_ABS_PINNED_HARD);
	timer->function = tick;
#endif
}
