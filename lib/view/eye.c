// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The geometry of looking; see eye.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "eye.h"

static double between(double low, double x, double high)
{
	return x < low ? low : x > high ? high : x;
}

bool incise_eye_hold(struct incise_view_camera *camera)
{
	if (!v3_finite(camera->target_mm) || !isfinite(camera->azimuth_deg) ||
	    !isfinite(camera->elevation_deg) || !isfinite(camera->distance_mm) ||
	    !isfinite(camera->fov_deg))
		return false;
	for (int i = 0; i < 3; i++)
		camera->target_mm[i] = between(-1e6, camera->target_mm[i], 1e6);
	camera->azimuth_deg = remainder(camera->azimuth_deg, 360);
	/* At ±90 there would be no way up. */
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

void incise_eye_look(const struct incise_view_camera *camera, int width, int height,
		     double reach_mm, struct incise_eye *eye)
{
	double azimuth = camera->azimuth_deg * M_PI / 180;
	double elevation = camera->elevation_deg * M_PI / 180;
	double near = fmax(camera->distance_mm - reach_mm, camera->distance_mm / 20);
	double far = camera->distance_mm + reach_mm;
	double tall = tan(camera->fov_deg * M_PI / 360);
	double turn[16] = {0}, lens[16] = {0};

	eye->back[0] = sin(azimuth) * cos(elevation);
	eye->back[1] = -cos(azimuth) * cos(elevation);
	eye->back[2] = sin(elevation);
	eye->right[0] = cos(azimuth);
	eye->right[1] = sin(azimuth);
	eye->right[2] = 0;
	v3_cross(eye->up, eye->back, eye->right);
	v3_add(eye->eye_mm, camera->target_mm, camera->distance_mm, eye->back);
	eye->half_height = tall;

	for (int i = 0; i < 3; i++) {
		turn[4 * i] = eye->right[i];
		turn[4 * i + 1] = eye->up[i];
		turn[4 * i + 2] = eye->back[i];
	}
	turn[12] = -v3_dot(eye->right, eye->eye_mm);
	turn[13] = -v3_dot(eye->up, eye->eye_mm);
	turn[14] = -v3_dot(eye->back, eye->eye_mm);
	turn[15] = 1;
	lens[0] = height / (width * tall);
	lens[5] = 1 / tall;
	lens[10] = -(far + near) / (far - near);
	lens[11] = -1;
	lens[14] = -2 * far * near / (far - near);
	multiply(eye->clip, lens, turn);
}

void incise_eye_way(const struct incise_eye *eye, int width, int height, double x_px,
		    double y_px, double way[3])
{
	double right = (2 * x_px - width) / height * eye->half_height;
	double up = (1 - 2 * y_px / height) * eye->half_height;
	double v[3] = {-eye->back[0], -eye->back[1], -eye->back[2]};

	v3_add(v, v, right, eye->right);
	v3_add(v, v, up, eye->up);
	if (!v3_unit(way, v, 0))
		v3_copy(way, v);
}

bool incise_eye_px(const struct incise_eye *eye, int width, int height,
		   const double point_mm[3], double px[2])
{
	double from[3], ahead;

	v3_sub(from, point_mm, eye->eye_mm);
	ahead = -v3_dot(from, eye->back) * eye->half_height;
	if (!(ahead > 0))
		return false;
	px[0] = 0.5 * (width + v3_dot(from, eye->right) / ahead * height);
	px[1] = 0.5 * height * (1 - v3_dot(from, eye->up) / ahead);
	return true;
}
