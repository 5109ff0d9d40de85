// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The surface at a place of the texture; see ground.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "ground.h"

/* Limits of a texel's length, mm; beyond them the map is degenerate. */
#define TEXEL_MIN_MM 1e-4
#define TEXEL_MAX_MM 100.0
/* Step for the slope of the relief, texels. */
#define RELIEF_PX 2.0
/* Below this sine it is level: no direction is down. */
#define LEVEL 1e-6

static bool metric_of(const double right[3], const double down[3],
		      struct ground_metric *metric)
{
	double a = v3_length(right), b, c;

	if (!(a > TEXEL_MIN_MM && a < TEXEL_MAX_MM))
		return false;
	b = v3_dot(right, down) / a;
	c = v3_dot(down, down) - b * b;
	if (!(c > TEXEL_MIN_MM * TEXEL_MIN_MM && c < TEXEL_MAX_MM * TEXEL_MAX_MM))
		return false;
	*metric = (struct ground_metric){(float)a, (float)b, (float)sqrt(c)};
	return true;
}

bool ground_metric(const struct uv_map *map, const double px[2],
		   struct ground_metric *metric)
{
	double right[3], down[3], point[3], normal[3];

	if (!uv_map_point(map, px, point, normal))
		return false;
	uv_map_metric(map, px, right, down);
	return metric_of(right, down, metric);
}

/* The rise of the relief over a texel to the right, or down. */
static double rise_mm(const struct uv_map *map, const double px[2], int axis)
{
	double before[2] = {px[0], px[1]}, after[2] = {px[0], px[1]};

	before[axis] = fmax(px[axis] - RELIEF_PX, 0);
	after[axis] = fmin(px[axis] + RELIEF_PX, map->size);
	return (uv_map_relief_mm(map, after) - uv_map_relief_mm(map, before)) /
	       (after[axis] - before[axis]);
}

bool ground_at(const struct uv_map *map, const double gravity[3], const double px[2],
	       struct ground *ground)
{
	double right[3], down[3], point[3], normal[3], g[2], e, f, h, det, x, y, length;

	if (!uv_map_point(map, px, point, normal))
		return false;
	uv_map_metric(map, px, right, down);
	v3_add(right, right, rise_mm(map, px, 0), normal);
	v3_add(down, down, rise_mm(map, px, 1), normal);
	if (!metric_of(right, down, &ground->metric))
		return false;
	ground->area_mm2 = (double)ground->metric.a * ground->metric.c;
	/* Gravity's component in the surface, x right + y down, by least squares. */
	g[0] = v3_dot(gravity, right);
	g[1] = v3_dot(gravity, down);
	e = v3_dot(right, right);
	f = v3_dot(right, down);
	h = v3_dot(down, down);
	det = e * h - f * f;
	x = (h * g[0] - f * g[1]) / det;
	y = (e * g[1] - f * g[0]) / det;
	length = sqrt(fmax(e * x * x + 2 * f * x * y + h * y * y, 0));
	ground->slope = fmin(length, 1);
	ground->down_px[0] = ground->down_px[1] = 0;
	ground->across_px[0] = ground->across_px[1] = 0;
	if (!(length > LEVEL))
		return true;
	x /= length;
	y /= length;
	ground->down_px[0] = x;
	ground->down_px[1] = y;
	/* A quarter turn in the surface. */
	ground->across_px[0] = -(f * x + h * y) / sqrt(det);
	ground->across_px[1] = (e * x + f * y) / sqrt(det);
	return true;
}

double ground_length_mm(const struct ground_metric *metric, double dx, double dy)
{
	double u = metric->a * dx + metric->b * dy, v = metric->c * dy;

	return sqrt(u * u + v * v);
}
