// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The camera in a hand; see orbit.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "eye.h"
#include "orbit.h"

#define DEG_PER_PX 0.35
#define DEG_PER_KEY 5.0
#define NEARER 0.9 /* for each notch of the wheel */

enum { MIDDLE = 2, RIGHT = 4 };

void incise_orbit_home(struct incise_orbit *orbit, const double target_mm[3],
		       const double along[3], double reach_mm)
{
	struct incise_view_camera *home = &orbit->home;

	v3_copy(home->target_mm, target_mm);
	/* From the side and above, a little from the end that is to the right. */
	home->azimuth_deg = 24;
	if (hypot(along[0], along[1]) > 1e-9)
		home->azimuth_deg += atan2(along[1], along[0]) * 180 / M_PI;
	home->elevation_deg = 42;
	home->fov_deg = 24;
	home->distance_mm = 3 * reach_mm;
	incise_eye_hold(home);
	orbit->camera = *home;
}

static void turn(struct incise_view_camera *camera, double azimuth, double elevation)
{
	camera->azimuth_deg += azimuth;
	camera->elevation_deg += elevation;
}

/* The target follows the mouse. */
static void move(struct incise_view_camera *camera, double dx, double dy, int height)
{
	struct incise_eye eye;
	double mm = 2 * tan(camera->fov_deg * M_PI / 360) * camera->distance_mm /
		    (height > 0 ? height : 1);

	incise_eye_look(camera, 16, 16, 1, &eye);
	v3_add(camera->target_mm, camera->target_mm, -dx * mm, eye.right);
	v3_add(camera->target_mm, camera->target_mm, dy * mm, eye.up);
}

static bool key(struct incise_orbit *orbit, int key)
{
	struct incise_view_camera *camera = &orbit->camera;

	switch (key) {
	case INCISE_VIEW_LEFT:
		turn(camera, -DEG_PER_KEY, 0);
		return true;
	case INCISE_VIEW_RIGHT:
		turn(camera, DEG_PER_KEY, 0);
		return true;
	case INCISE_VIEW_UP:
		turn(camera, 0, DEG_PER_KEY);
		return true;
	case INCISE_VIEW_DOWN:
		turn(camera, 0, -DEG_PER_KEY);
		return true;
	case INCISE_VIEW_PAGE_UP:
		camera->distance_mm *= NEARER;
		return true;
	case INCISE_VIEW_PAGE_DOWN:
		camera->distance_mm /= NEARER;
		return true;
	case INCISE_VIEW_HOME:
		*camera = orbit->home;
		return true;
	}
	return false;
}

bool incise_orbit_event(struct incise_orbit *orbit, const struct incise_view_event *event,
			int height)
{
	double dx = event->x_px - orbit->x_px, dy = event->y_px - orbit->y_px;
	const struct incise_view_camera before = orbit->camera;
	bool used = false;

	switch (event->type) {
	case INCISE_VIEW_MOTION:
		used = event->buttons & (MIDDLE | RIGHT);
		if (event->buttons & RIGHT)
			turn(&orbit->camera, -dx * DEG_PER_PX, dy * DEG_PER_PX);
		else if (event->buttons & MIDDLE)
			move(&orbit->camera, dx, dy, height);
		break;
	case INCISE_VIEW_WHEEL:
		orbit->camera.distance_mm *= pow(NEARER, event->wheel);
		used = true;
		break;
	case INCISE_VIEW_BUTTON:
		used = event->button == 2 || event->button == 3;
		break;
	case INCISE_VIEW_KEY:
		used = event->pressed && key(orbit, event->key);
		break;
	default:
		break;
	}
	if (event->type == INCISE_VIEW_MOTION || event->type == INCISE_VIEW_BUTTON) {
		orbit->x_px = event->x_px;
		orbit->y_px = event->y_px;
	}
	if (!incise_eye_hold(&orbit->camera))
		orbit->camera = before;
	return used;
}
