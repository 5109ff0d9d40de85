/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * Where kernels 6.1 to 6.17 differ: chosen by compile probes. (Callbacks whose
 * type has changed are chosen by that type, where they are set.)
 */
#ifndef INCISE_SIM_BRIDGE_H
#define INCISE_SIM_BRIDGE_H

#include <linux/hrtimer.h>

/* hrtimer_setup() is from 6.13, hrtimer_init() went with 6.15. */
static inline void sim_timer_init(struct hrtimer *timer,
				  enum hrtimer_restart (*fire)(struct hrtimer *),
				  enum hrtimer_mode mode)
{
#ifdef INCISE_HAVE_HRTIMER_SETUP
	hrtimer_setup(timer, fire, CLOCK_MONOTONIC, mode);
#else
	hrtimer_init(timer, CLOCK_MONOTONIC, mode);
	timer->function = fire;
#endif
}

#endif
