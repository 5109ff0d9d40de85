/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a timeline remembers of its line, for those who look at it afterwards.
 *
 *     start        middle of       middle of           middle of    last
 *     of line      64 blocks       64 blocks           the last 64  sample
 *       o──────────────o───────────────o── · · · ───────o────────────o
 *       extrapolated   a knot each 16 s                 extrapolated
 *
 * A line is surest in the middle of its blocks: that is where a knot is made of it. When
 * there is no more room, every second knot goes and the step doubles: 68 min at 16 s.
 */
#ifndef INCISE_TIMELINE_KNOTS_H
#define INCISE_TIMELINE_KNOTS_H

#include "timeline.h"

/* The line was drawn anew. */
void incise_timeline_extend(struct incise_timeline *timeline);

/* The line has ended: its last knots are made. */
void incise_timeline_end_line(struct incise_timeline *timeline);

/* By how much periods are longer than the nominal one, as a part of it. */
bool incise_timeline_slope(const struct incise_timeline *timeline, double *slope,
			   double *slope_sd);

#endif
