/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The camera of a view: matrices for OpenGL, the ray of a pixel, and its control. See the drawing
 * in incise/view.h. Matrices are column by column; lengths in mm.
 *
 *      camera frame:  y up          clip space: -1 … 1, near at -1
 *                     │
 *                     ○──▶ x right; looks along -z
 */
#ifndef INCISE_VIEW_CAMERA_H
#define INCISE_VIEW_CAMERA_H

#include <stdbool.h>
#include <incise/view.h>

struct view_projection {
	double position_mm[3];
	double right[3], up[3], back[3]; /* unit, at right angles */
	float clip[16];			 /* of a place in mm */
	double half_height;		 /* of the frame at distance 1 */
};

/* Limit all values to their ranges; false, without changes, if one is not finite. */
bool view_camera_limit(struct incise_view_camera *camera);

/*
 * @reach_mm: everything that is drawn is closer to the target
 */
void view_camera_project(const struct incise_view_camera *camera, int width, int height,
			 double reach_mm, struct view_projection *projection);

/* The unit vector of a pixel's ray. */
void view_camera_ray(const struct view_projection *projection, int width, int height,
		     double x_px, double y_px, double way[3]);

/*
 * The camera under control of mouse and keys: right button and arrows turn it round its target, the
 * middle button moves the target, the wheel changes the distance.
 */
struct view_orbit {
	struct incise_view_camera camera, home;
	double x_px, y_px; /* of the last motion */
};

/* @along: a direction that shall run to the right, such as a neck's axis. */
void view_orbit_home(struct view_orbit *orbit, const double target_mm[3],
		     const double along[3], double reach_mm);

/* @height of the frame, pixels. Returns whether the event was used. */
bool view_orbit_event(struct view_orbit *orbit, const struct incise_view_event *event,
		      int height);

#endif
