/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pictures of incise bench timeline: a panel per kind of lateness, of the fastest clock.
 */
#ifndef INCISE_TIMELINE_PICTURE_H
#define INCISE_TIMELINE_PICTURE_H

#include "bench_timeline.h"

/* Error over the cost of a sample, NAME; over the window, NAME-windows. */
void timeline_picture_cost(const struct timeline_table *table, const char *folder,
			   const char *name);
void timeline_picture_windows(const struct timeline_table *table, const char *folder,
			      const char *name);

#endif
