// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The camera of a view; see view_camera.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "view_camera.h"

static double between(double low, double x, double high)
{
	return x < low ? low : x > high ? high : x;
}

bool view_camera_limit(struct incise_view_camera *camera)
{
	if (!v3_finite(camera->target_mm) || !isfinite(camera->azimuth_deg) ||
	    !isfinite(camera->elevation_deg) || !isfinite(camera->distance_mm) ||
	    !isfinite(camera->fov_deg))
		return false;
	for (int i = 0; i < 3; i++)
		camera->target_mm[i] = between(-1e6, camera->target_mm[i], 1e6);
	camera->azimuth_deg = remainder(camera->azimuth_deg, 360);
	/* At ±90 there is no unique upward direction. */
	camera->elevation_deg = between(-89, camera->elevation_deg, 89);
	camera->distance_mm = between(1, camera->distance_mm, 1e5);
	camera->fov_deg = between(5, camera->fov_deg, 120);
	return true;
}

static void multiply(float to[16], const double a[16], const double b[16])
{
	for (int column = 0; column < 4; column++)
		for (int row = 0; row < 4; row++) {
			double sum = 0;

			for (int k = 0; k < 4; k++)
				sum += a[4 * k + row] * b[4 * column + k];
			to[4 * column + row] = (float)sum;
		}
}

void view_camera_project(const struct incise_view_camera *camera, int width, int height,
			 double reach_mm, struct view_projection *projection)
{
	double azimuth = camera->azimuth_deg * M_PI / 180;
	double elevation = camera->elevation_deg * M_PI / 180;
	double near = fmax(camera->distance_mm - reach_mm, camera->distance_mm / 20);
	double far = camera->distance_mm + reach_mm;
	double tall = tan(camera->fov_deg * M_PI / 360);
	double turn[16] = {0}, lens[16] = {0};

	projection->back[0] = sin(azimuth) * cos(elevation);
	projection->back[1] = -cos(azimuth) * cos(elevation);
	projection->back[2] = sin(elevation);
	projection->right[0] = cos(azimuth);
	projection->right[1] = sin(azimuth);
	projection->right[2] = 0;
	v3_cross(projection->up, projection->back, projection->right);
	v3_add(projection->position_mm, camera->target_mm, camera->distance_mm,
	       projection->back);
	projection->half_height = tall;

	for (int i = 0; i < 3; i++) {
		turn[4 * i] = projection->right[i];
		turn[4 * i + 1] = projection->up[i];
		turn[4 * i + 2] = projection->back[i];
	}
	turn[12] = -v3_dot(projection->right, projection->position_mm);
	turn[13] = -v3_dot(projection->up, projection->position_mm);
	turn[14] = -v3_dot(projection->back, projection->position_mm);
	turn[15] = 1;
	lens[0] = height / (width * tall);
	lens[5] = 1 / tall;
	lens[10] = -(far + near) / (far - near);
	lens[11] = -1;
	lens[14] = -2 * far * near / (far - near);
	multiply(projection->clip, lens, turn);
}

void view_camera_ray(const struct view_projection *projection, int width, int height,
		     double x_px, double y_px, double way[3])
{
	double right = (2 * x_px - width) / height * projection->half_height;
	double up = (1 - 2 * y_px / height) * projection->half_height;
	double v[3] = {-projection->back[0], -projection->back[1], -projection->back[2]};

	v3_add(v, v, right, projection->right);
	v3_add(v, v, up, projection->up);
	if (!v3_unit(way, v, 0))
		v3_copy(way, v);
}

/* --- Orbit: mouse and keys move the camera --- */

#define DEG_PER_PX 0.35
#define DEG_PER_KEY 5.0
#define NEARER 0.9 /* per notch of the wheel */

enum { MIDDLE = 2, RIGHT = 4 };

void view_orbit_home(struct view_orbit *orbit, const double target_mm[3],
		     const double along[3], double reach_mm)
{
	struct incise_view_camera *home = &orbit->home;

	v3_copy(home->target_mm, target_mm);
	/* From the side and above, slightly from the right end. */
	home->azimuth_deg = 24;
	if (hypot(along[0], along[1]) > 1e-9)
		home->azimuth_deg += atan2(along[1], along[0]) * 180 / M_PI;
	home->elevation_deg = 42;
	home->fov_deg = 24;
	home->distance_mm = 3 * reach_mm;
	view_camera_limit(home);
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
	struct view_projection projection;
	double mm = 2 * tan(camera->fov_deg * M_PI / 360) * camera->distance_mm /
		    (height > 0 ? height : 1);

	view_camera_project(camera, 16, 16, 1, &projection);
	v3_add(camera->target_mm, camera->target_mm, -dx * mm, projection.right);
	v3_add(camera->target_mm, camera->target_mm, dy * mm, projection.up);
}

static bool key(struct view_orbit *orbit, int key)
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

bool view_orbit_event(struct view_orbit *orbit, const struct incise_view_event *event,
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
	if (!view_camera_limit(&orbit->camera))
		orbit->camera = before;
	return used;
}
