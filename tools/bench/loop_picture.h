/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pictures of incise bench loop: NAME-wakeups, NAME-rates.
 */
#ifndef INCISE_LOOP_PICTURE_H
#define INCISE_LOOP_PICTURE_H

#include "bench_rate.h"
#include "bench_wakeup.h"

/* Histograms of lateness, the loop's and cyclictest's; nothing where nothing was measured. */
void loop_picture_wakeups(const struct wakeups *wakeups, const char *folder,
			  const char *name);

/* Error of the force over the loop's rate, and over what that costs. */
void loop_picture_rates(const struct rates *rates, const char *folder, const char *name);

#endif
