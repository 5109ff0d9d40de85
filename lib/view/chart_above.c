// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A chart seen straight from above, around the surface's top: a point's texel is where it lies
 * over the plane through the top, and a texel's point where a ray from above meets the
 * surface first.
 *
 *                 up ▲    texels
 *        ────┬───┬───●───┬───┬────   plane at the top (origin)
 *            ╎  _╎--‾╎‾--╎_  ╎
 *            ╎/  ╎   ╎   ╎  \╎       what lies under an overhang is not seen
 */
#include "../base/vector.h"
#include "../surface/surface.h"
#include "chart_kind.h"

#define SIDE_MAX_MM 120.0

/* Of a ball's radius: at the corners of the texture its slope is then 58°. */
#define BALL_SHARE 0.6

/* A slope steeper than this (87°) is measured as this. */
#define FACING_MIN 0.05

/* A point this share of the side above or below the surface still belongs to it. */
#define NEAR_SHARE (1 / 12.0)

/* From the least to the most of a mesh along one way, mm from the origin. */
static void mesh_reach(const struct incise_chart *chart, const double way[3],
		       double reach[2])
{
	const struct mesh *mesh = chart->surface->mesh;

	reach[0] = reach[1] = 0;
	for (uint32_t i = 0; i < mesh->n_vertices; i++) {
		double out[3], at;

		v3_sub(out, mesh->vertex[i], chart->origin);
		at = v3_dot(out, way);
		reach[0] = fmin(reach[0], at);
		reach[1] = fmax(reach[1], at);
	}
}

/*
 * A texture as large as the mesh, or as is allowed; then it is moved so that it lies on
 * the mesh as far as it can, with the top on it. Returns half its side.
 */
static double fit_mesh(struct incise_chart *chart)
{
	double reach[2][2], high[2], half;

	mesh_reach(chart, chart->right, reach[0]);
	mesh_reach(chart, chart->down, reach[1]);
	mesh_reach(chart, chart->up, high);
	chart->above_mm = high[1];
	chart->below_mm = -high[0];
	half = fmin(fmax(reach[0][1] - reach[0][0], reach[1][1] - reach[1][0]),
		    SIDE_MAX_MM) /
	       2;
	for (int i = 0; i < 2; i++) {
		double middle = (reach[i][0] + reach[i][1]) / 2;
		double least = fmin(reach[i][0] + half, middle);
		double most = fmax(reach[i][1] - half, middle);
		double move = fmin(fmax(0, least), most);

		v3_add(chart->origin, chart->origin, move,
		       i ? chart->down : chart->right);
		chart->top_mm[i] = -move;
	}
	return half;
}

void chart_above_init(struct incise_chart *chart)
{
	const struct incise_surface *surface = chart->surface;
	const double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3] = {0, 0, 1};
	struct incise_touch top;
	double half = SIDE_MAX_MM / 2, side[3];

	chart->kind = CHART_FROM_ABOVE;
	incise_surface_top(surface, &top);
	v3_copy(chart->origin, top.point_mm);
	/* The highest place is seen from above, whatever way its own triangle faces. */
	if (surface->kind == INCISE_SURFACE_PLANE ||
	    (surface->mesh && top.normal[2] < 0.3))
		v3_copy(chart->up, top.normal);
	else
		v3_copy(chart->up, z);
	v3_add(side, x, -v3_dot(x, chart->up), chart->up);
	if (!v3_unit(chart->right, side, 0.1)) {
		v3_add(side, y, -v3_dot(y, chart->up), chart->up);
		v3_unit(chart->right, side, 0);
	}
	v3_cross(chart->down, chart->right, chart->up);
	if (surface->mesh)
		half = fit_mesh(chart);
	else if (surface->kind != INCISE_SURFACE_PLANE) {
		half = fmin(half, BALL_SHARE * surface->capsule.radius);
		chart->below_mm = surface->capsule.radius;
	}
	/* A mesh that stands on edge has no extent; what is seen of it does not matter. */
	half = fmax(half, 1e-9);
	chart->above_mm += half;
	chart->below_mm += half;
	chart->wide_mm = chart->high_mm = 2 * half;
}

/* A place over the plane, mm from its middle. */
static void over(const struct incise_chart *chart, const double px[2], double height_mm,
		 double to[3])
{
	double mm = chart->wide_mm / chart->size;

	v3_add(to, chart->origin, (px[0] - 0.5 * chart->size) * mm, chart->right);
	v3_add(to, to, (px[1] - 0.5 * chart->size) * mm, chart->down);
	v3_add(to, to, height_mm, chart->up);
}

bool chart_above_point(const struct incise_chart *chart, const double px[2],
		       double point_mm[3], double normal[3])
{
	struct incise_touch touch;
	double from[3], to[3];

	over(chart, px, chart->above_mm, from);
	over(chart, px, -chart->below_mm, to);
	if (!incise_surface_enters(chart->surface, from, to, &touch))
		return false;
	v3_copy(point_mm, touch.point_mm);
	v3_copy(normal, touch.normal);
	return true;
}

bool chart_above_px(const struct incise_chart *chart, const double point_mm[3],
		    double px[2])
{
	double out[3], there[3], normal[3], at[2];

	v3_sub(out, point_mm, chart->origin);
	at[0] = chart->size * (0.5 + v3_dot(out, chart->right) / chart->wide_mm);
	at[1] = chart->size * (0.5 + v3_dot(out, chart->down) / chart->high_mm);
	if (!(at[0] >= 0 && at[0] <= chart->size && at[1] >= 0 && at[1] <= chart->size))
		return false;
	/* At the border of a mesh the ray may just miss it: then the point is believed. */
	if (chart_above_point(chart, at, there, normal)) {
		v3_sub(out, point_mm, there);
		if (!(fabs(v3_dot(out, chart->up)) <= NEAR_SHARE * chart->wide_mm))
			return false;
	}
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

bool chart_above_metric(const struct incise_chart *chart, const double px[2],
			double right_mm[3], double down_mm[3])
{
	double point[3], normal[3], facing, mm = chart->wide_mm / chart->size;

	if (!chart_above_point(chart, px, point, normal))
		return false;
	facing = fmax(v3_dot(normal, chart->up), FACING_MIN);
	/* A step to the side stays on the surface: it goes down as the surface does. */
	for (int i = 0; i < 3; i++) {
		right_mm[i] = mm * (chart->right[i] -
				    v3_dot(chart->right, normal) / facing * chart->up[i]);
		down_mm[i] = mm * (chart->down[i] -
				   v3_dot(chart->down, normal) / facing * chart->up[i]);
	}
	return true;
}
