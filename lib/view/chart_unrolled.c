// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A capsule's upper side unrolled. Lengths along (s) and around are arcs, so that texels
 * on the cylinder are rectangles, and of a neck nearly squares.
 *
 *        ╭──╮─────────────────────────╭──╮
 *       s < 0  0        s      axis_mm    s > axis_mm: meridians of the round end
 *        ╰──╯─────────────────────────╰──╯
 *
 *          up ▲  turn          point = a + t axis + R (cos e/R (cos turn up + sin turn down)
 *             │╱                            + sin e/R axis), t = s within 0 … axis_mm, e = s - t
 *          ───┼───► down
 */
#include "../base/vector.h"
#include "../surface/surface.h"
#include "chart_kind.h"

#define WIDE_MAX_MM 160.0
#define TURN_MAX (80 * M_PI / 180)

/* Longer than wide by this at most: a finger is not stretched to a neck. */
#define STRETCH_MAX 1.5

/* So far over the round ends, in radius: 69°, where texels are 0.36 as high. */
#define END_MAX 1.2

/* A capsule that rises more steeply than this sine is seen from above. */
#define STANDS 0.7

bool chart_unrolled_init(struct incise_chart *chart)
{
	const struct capsule *capsule = &chart->surface->capsule;
	double axis[3], up[3], out[3], end, least, most, leans, at;
	struct incise_touch top;

	v3_sub(axis, capsule->b, capsule->a);
	incise_surface_top(chart->surface, &top);
	if (!v3_unit(chart->right, axis, 1e-6 * capsule->radius))
		return false;
	leans = v3_dot(top.normal, chart->right);
	v3_add(up, top.normal, -leans, chart->right);
	if (fabs(leans) > STANDS || !v3_unit(chart->up, up, 0))
		return false;
	chart->kind = CHART_UNROLLED;
	v3_cross(chart->down, chart->right, chart->up);
	v3_copy(chart->origin, capsule->a);
	chart->radius_mm = capsule->radius;
	chart->axis_mm = v3_length(axis);
	end = END_MAX * chart->radius_mm;
	chart->high_mm = fmin(2 * TURN_MAX * chart->radius_mm, WIDE_MAX_MM);
	chart->wide_mm = fmin(fmin(WIDE_MAX_MM, STRETCH_MAX * chart->high_mm),
			      chart->axis_mm + 2 * end);
	v3_sub(out, top.point_mm, chart->origin);
	v3_add(out, out, -chart->radius_mm, top.normal);
	least = chart->wide_mm / 2 - end;
	most = chart->axis_mm + end - chart->wide_mm / 2;
	at = v3_dot(out, chart->right) + chart->radius_mm * asin(leans);
	chart->middle_mm = fmax(fmin(at, most), least);
	chart->top_mm[0] = at - chart->middle_mm;
	return true;
}

bool chart_unrolled_px(const struct incise_chart *chart, const double point_mm[3],
		       double px[2])
{
	double out[3], t, end, up, down, turn, at[2];

	v3_sub(out, point_mm, chart->origin);
	end = v3_dot(out, chart->right);
	t = fmin(fmax(end, 0), chart->axis_mm);
	end -= t;
	up = v3_dot(out, chart->up);
	down = v3_dot(out, chart->down);
	turn = atan2(down, up);
	t += chart->radius_mm * atan2(end, hypot(up, down));
	at[0] = chart->size * (0.5 + (t - chart->middle_mm) / chart->wide_mm);
	at[1] = chart->size * (0.5 + turn * chart->radius_mm / chart->high_mm);
	if (!(at[0] >= 0 && at[0] <= chart->size && at[1] >= 0 && at[1] <= chart->size))
		return false;
	px[0] = at[0];
	px[1] = at[1];
	return true;
}

/* Of a texel: the place on the axis and the angles towards its end and around it. */
static double turns(const struct incise_chart *chart, const double px[2], double *end,
		    double *turn)
{
	double s = chart->middle_mm + (px[0] / chart->size - 0.5) * chart->wide_mm;
	double t = fmin(fmax(s, 0), chart->axis_mm);

	*end = (s - t) / chart->radius_mm;
	*turn = (px[1] / chart->size - 0.5) * chart->high_mm / chart->radius_mm;
	return t;
}

void chart_unrolled_point(const struct incise_chart *chart, const double px[2],
			  double point_mm[3], double normal[3])
{
	double end, turn, t = turns(chart, px, &end, &turn);

	for (int i = 0; i < 3; i++)
		normal[i] = cos(end) * (cos(turn) * chart->up[i] +
					sin(turn) * chart->down[i]) +
			    sin(end) * chart->right[i];
	v3_add(point_mm, chart->origin, t, chart->right);
	v3_add(point_mm, point_mm, chart->radius_mm, normal);
}

void chart_unrolled_metric(const struct incise_chart *chart, const double px[2],
			   double right_mm[3], double down_mm[3])
{
	double end, turn, wide = chart->wide_mm / chart->size;
	double high = chart->high_mm / chart->size;

	turns(chart, px, &end, &turn);
	for (int i = 0; i < 3; i++) {
		double out = cos(turn) * chart->up[i] + sin(turn) * chart->down[i];

		right_mm[i] = wide * (cos(end) * chart->right[i] - sin(end) * out);
		down_mm[i] = high * cos(end) *
			     (cos(turn) * chart->down[i] - sin(turn) * chart->up[i]);
	}
}
