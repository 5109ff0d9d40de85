// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ground for tests of wound, blood and injury: a plane, level or tilted, or the neck, with
 * its map; and ticks of a blade, handle or tube on it.
 */
#ifndef TESTS_VIEW_GROUND_H
#define TESTS_VIEW_GROUND_H

#include <math.h>
#include <string.h>
#include "../../../lib/surface/surface.h"
#include "../../../lib/view/injury.h"

struct field {
	struct incise_surface *surface;
	struct uv_map *map;
	struct incise_scene_picture picture;
	double mm; /* per texel, in the middle */
};

/* tilt_deg: the plane's downhill is +y then; below 0: a neck along x. */
static inline void field_new(struct field *field, int size, double tilt_deg)
{
	const double point[3] = {0, 0, 0}, a[3] = {-60, 0, -55}, b[3] = {160, 0, -55};
	double tilt = tilt_deg * M_PI / 180, normal[3] = {0, sin(tilt), cos(tilt)};
	double middle[2] = {size / 2.0, size / 2.0}, right[3], down[3];

	field->picture = (struct incise_scene_picture){
		.wound = true,
		.bleeding = true,
		.texture_px = size,
		.gravity = {0, 0, -1},
		.blood_ul_s_mm2 = 0.1,
		.viscosity_mPa_s = 4,
		.seed = 1,
	};
	field->surface = tilt_deg < 0 ? incise_surface_new_capsule(a, b, 55, NULL)
				      : incise_surface_new_plane(point, normal, NULL);
	assert_non_null(field->surface);
	field->map = uv_map_new(field->surface, &field->picture, NULL);
	assert_non_null(field->map);
	uv_map_metric(field->map, middle, right, down);
	field->mm = sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2]);
}

static inline void field_free(struct field *field)
{
	uv_map_free(field->map);
	incise_surface_free(field->surface);
}

static inline struct incise_tick tick_free(double t_s)
{
	return (struct incise_tick){
		.t_ns = (int64_t)(t_s * 1e9),
		.quaternion = {1, 0, 0, 0},
		.tool = INCISE_TOOL_BLADE,
	};
}

/* In the tissue below a place of the texture, given in mm from its middle. */
static inline struct incise_tick tick_at(const struct field *field, double t_s,
					 enum incise_tool tool, double right_mm,
					 double down_mm, double depth_mm)
{
	struct incise_tick tick = tick_free(t_s);
	double half = field->map->size / 2.0;
	double px[2] = {half + right_mm / field->mm, half + down_mm / field->mm};

	tick.tool = tool;
	tick.phase =
		tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING : INCISE_PHASE_INSERTION;
	tick.flags = INCISE_TICK_CONTACT;
	assert_true(uv_map_point(field->map, px, tick.proxy_mm, tick.normal));
	tick.depth_mm = depth_mm;
	for (int i = 0; i < 3; i++)
		tick.tool_mm[i] = tick.position_mm[i] =
			tick.proxy_mm[i] - depth_mm * tick.normal[i];
	return tick;
}

#endif
