/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The pixel of a place: the inverse of view_camera_ray(). */
#ifndef INCISE_TEST_PROJECT_H
#define INCISE_TEST_PROJECT_H

#include "../../../lib/base/vector.h"
#include "../../../lib/view/view_camera.h"

/* False: the place is behind the camera. */
static inline bool project(const struct view_projection *projection, int width,
			   int height, const double point_mm[3], double px[2])
{
	double from[3], ahead;

	px[0] = px[1] = 0;
	v3_sub(from, point_mm, projection->position_mm);
	ahead = -v3_dot(from, projection->back) * projection->half_height;
	if (!(ahead > 0))
		return false;
	px[0] = 0.5 * (width + v3_dot(from, projection->right) / ahead * height);
	px[1] = 0.5 * height * (1 - v3_dot(from, projection->up) / ahead);
	return true;
}

#endif
