/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stroke over the top of a plan's surface, of a sheet over its middle, as poses for incise_plan_feed(): from above into
 * the tissue in 0.2 s, then to and fro below it.
 *
 *     \                     5 mm above
 *   ───\──────────────────   surface
 *       ╰◀────────▶        1 mm deep, 5 mm to either side, 40 mm/s
 */
#ifndef INCISE_STROKE_H
#define INCISE_STROKE_H

#include <incise/plan.h>

#define STROKE_DOWN_S 0.2

struct stroke {
	const struct incise_tracker_info *tracker;
	struct incise_touch top;
	double along[3]; /* in the surface */
};

/* @tracker: what the plan was made for; must outlive the stroke. */
void stroke_begin(struct stroke *stroke, const struct incise_plan *plan,
		  const struct incise_tracker_info *tracker);

/* The pose of that number, from 0; sample->t_ns says when it arrives. */
void stroke_pose(const struct stroke *stroke, int64_t pose,
		 struct incise_tracker_sample *sample);

#endif
