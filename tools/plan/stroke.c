// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A stroke over a plan's surface; see stroke.h.
 */
#include <math.h>
#include <string.h>
#include "stroke.h"

#define NS 1e-9
#define ABOVE_MM 5.0
#define DEPTH_MM 1.0
#define REACH_MM 5.0
#define STROKE_HZ 1.27 /* 5 mm · 2π · 1.27 Hz = 40 mm/s */

void stroke_begin(struct stroke *stroke, const struct incise_plan *plan,
		  const struct incise_tracker_info *tracker)
{
	const double *n = stroke->top.normal;
	struct incise_surface_size shape;
	double size;

	stroke->tracker = tracker;
	incise_plan_top(plan, &stroke->top);
	/* The top of a sheet may lie on its border, where a contact ends. */
	if (incise_surface_size(incise_plan_surface(plan), &shape) && shape.open_edges)
		stroke->top = shape.inner;
	/* Across the normal, in the plane of its largest part and the next axis. */
	memset(stroke->along, 0, sizeof(stroke->along));
	for (int i = 0; i < 3; i++)
		if (fabs(n[i]) >= fabs(n[(i + 1) % 3]) &&
		    fabs(n[i]) >= fabs(n[(i + 2) % 3])) {
			size = hypot(n[i], n[(i + 1) % 3]);
			stroke->along[(i + 1) % 3] = n[i] / size;
			stroke->along[i] = -n[(i + 1) % 3] / size;
			break;
		}
}

void stroke_pose(const struct stroke *stroke, int64_t pose,
		 struct incise_tracker_sample *sample)
{
	double t = (double)pose / incise_tracker_station_hz(stroke->tracker);
	double down = fmin(t / STROKE_DOWN_S, 1);
	double above = ABOVE_MM - (ABOVE_MM + DEPTH_MM) * down;
	double off = REACH_MM * sin(2 * M_PI * STROKE_HZ * t);

	*sample = (struct incise_tracker_sample){
		.t_ns = llrint(t / NS) + stroke->tracker->latency_ns,
		.quaternion = {1},
		.status = ' ',
	};
	for (int i = 0; i < 3; i++)
		sample->position_mm[i] = stroke->top.point_mm[i] +
					 above * stroke->top.normal[i] +
					 off * stroke->along[i];
}
