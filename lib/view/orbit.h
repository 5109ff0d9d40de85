/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The camera in a hand: it goes round its target by the right button and by arrows, moves
 * it by the middle one, comes near by the wheel.
 */
#ifndef INCISE_VIEW_ORBIT_H
#define INCISE_VIEW_ORBIT_H

#include <stdbool.h>
#include <incise/view.h>

struct incise_orbit {
	struct incise_view_camera camera, home;
	double x_px, y_px; /* of the last motion */
};

/* @along: a way in the picture that shall run to the right, as a neck's axis. */
void incise_orbit_home(struct incise_orbit *orbit, const double target_mm[3],
		       const double along[3], double reach_mm);

/* @height of the frame, pixels. Whether the camera took the event. */
bool incise_orbit_event(struct incise_orbit *orbit, const struct incise_view_event *event,
			int height);

#endif
