// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What lens and pose say of the cutting plane; see board.h. Every figure is a function of
 * the lens and of the pose in the plane, 14 numbers; its variance is gᵀ C g with a gradient
 * by differences of a tenth of each number's own standard deviation.
 *
 * A part of one noun: tests/unit/calib/board.c tests it through its door.
 */
#include <math.h>
#include <string.h>
#include "../base/vector.h"
#include "board.h"

#define GRID 9	       /* places in the region, both ways */
#define AXIS_PLACES 33 /* on the axis */
#define REACH_PX 8.0   /* to both sides of a place that a scale is taken over */

struct state {
	union board_lens lens;
	double pose[BOARD_POSE];
};

static double *number_of(struct state *state, int i)
{
	return i < BOARD_LENS ? &state->lens.number[i] : &state->pose[i - BOARD_LENS];
}

static double apart(const struct state *state, const double a[2], const double b[2])
{
	double from[2], to[2];

	board_meet(&state->lens, state->pose, a, from);
	board_meet(&state->lens, state->pose, b, to);
	return hypot(to[0] - from[0], to[1] - from[1]) / hypot(b[0] - a[0], b[1] - a[1]);
}

static double axis_scale(const struct incise_board_views *views,
			 const struct state *state)
{
	return apart(state, views->axis_px[0], views->axis_px[1]);
}

/* Component k of the plane's normal as the camera has it. */
static double normal_of(const struct state *state, int k)
{
	double r[9];

	board_rotation(state->pose, r);
	return r[3 * k + 2];
}

static double cov(const struct board_solution *s, int i, int j)
{
	int a = i < BOARD_LENS ? i : s->plane_at + i - BOARD_LENS;
	int b = j < BOARD_LENS ? j : s->plane_at + j - BOARD_LENS;

	return s->covariance[(size_t)a * s->n_unknowns + b];
}

/* k -1: the scale; 0, 1: the normal's x, y. */
static double figure(const struct incise_board_views *views, const struct state *state,
		     int k)
{
	return k < 0 ? axis_scale(views, state) : normal_of(state, k);
}

static void gradient(const struct incise_board_views *views,
		     const struct board_solution *s, const struct state *state, int k,
		     double g[BOARD_LENS + BOARD_POSE])
{
	struct state moved = *state;

	for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++) {
		double step = fmax(0.1 * sqrt(fmax(0, cov(s, i, i))), 1e-12);
		double *x = number_of(&moved, i), was = *x, up, down;

		*x = was + step;
		up = figure(views, &moved, k);
		*x = was - step;
		down = figure(views, &moved, k);
		*x = was;
		g[i] = (up - down) / (2 * step);
	}
}

static double variance(const struct board_solution *s, const double *g, const double *h)
{
	double sum = 0;

	for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++)
		for (int j = 0; j < BOARD_LENS + BOARD_POSE; j++)
			sum += g[i] * cov(s, i, j) * h[j];
	return sum;
}

static void find_tilt(const struct incise_board_views *views,
		      const struct board_solution *s, const struct state *state,
		      struct incise_board_fit *fit)
{
	double g[2][BOARD_LENS + BOARD_POSE], n[2], xx, xy, yy, largest;

	for (int k = 0; k < 2; k++) {
		n[k] = normal_of(state, k);
		gradient(views, s, state, k, g[k]);
	}
	fit->tilt_deg = asin(fmin(1, hypot(n[0], n[1]))) * 180 / M_PI;
	xx = variance(s, g[0], g[0]);
	xy = variance(s, g[0], g[1]);
	yy = variance(s, g[1], g[1]);
	largest = (xx + yy) / 2 + hypot((xx - yy) / 2, xy);
	fit->u_tilt_deg = sqrt(fmax(0, largest)) * 180 / M_PI;
}

/* How the scale along the axis differs within the region, and one number from the truth. */
static void find_change(const struct incise_board_views *views, const struct state *state,
			struct incise_board_fit *fit)
{
	const double *top = views->axis_px[0], *bottom = views->axis_px[1];
	double way[2] = {bottom[0] - top[0], bottom[1] - top[1]};
	double length = hypot(way[0], way[1]), whole[2], from[2];

	way[0] /= length;
	way[1] /= length;
	fit->low_mm_px = HUGE_VAL;
	fit->high_mm_px = 0;
	for (int i = 0; i < GRID * GRID; i++) {
		const double(*region)[2] = views->region_px;
		double part[2] = {(double)(i % GRID) / (GRID - 1),
				  (double)(i / GRID) / (GRID - 1)};
		double a[2], b[2], scale;

		for (int k = 0; k < 2; k++) {
			double at =
				region[0][k] + part[k] * (region[1][k] - region[0][k]);

			a[k] = at - REACH_PX * way[k];
			b[k] = at + REACH_PX * way[k];
		}
		scale = apart(state, a, b);
		fit->low_mm_px = fmin(fit->low_mm_px, scale);
		fit->high_mm_px = fmax(fit->high_mm_px, scale);
	}
	/* Depth is counted from the lower end's place at full length: both ends agree. */
	board_meet(&state->lens, state->pose, top, from);
	board_meet(&state->lens, state->pose, bottom, whole);
	for (int i = 1; i < AXIS_PLACES - 1; i++) {
		double s = length * i / (AXIS_PLACES - 1), at[2], mm[2];

		at[0] = top[0] + s * way[0];
		at[1] = top[1] + s * way[1];
		board_meet(&state->lens, state->pose, at, mm);
		fit->bend_mm =
			fmax(fit->bend_mm, fabs(hypot(mm[0] - from[0], mm[1] - from[1]) -
						s * fit->mm_px));
	}
}

static void find_residual(const struct incise_board_views *views,
			  const struct state *state, struct incise_board_fit *fit)
{
	int corners = views->columns * views->rows;
	const double *px = views->corners + (size_t)2 * corners * views->plane;
	double sum = 0;

	for (int i = 0; i < corners; i++) {
		double mm[2], seen[2], off;

		board_corner(views, i, mm);
		board_meet(&state->lens, state->pose, px + 2 * i, seen);
		off = hypot(seen[0] - mm[0], seen[1] - mm[1]);
		sum += off * off;
		fit->plane_largest_mm = fmax(fit->plane_largest_mm, off);
	}
	fit->plane_rms_mm = sqrt(sum / corners);
}

/* The inverse of K [r1 r2 t], by cofactors, with its last number 1. */
static void find_homography(const struct state *state, double h[9])
{
	const struct incise_board_lens *l = &state->lens.by_name;
	double r[9], m[9];

	board_rotation(state->pose, r);
	for (int j = 0; j < 3; j++) {
		double c[3];

		for (int i = 0; i < 3; i++)
			c[i] = j < 2 ? r[3 * i + j] : state->pose[3 + i];
		m[j] = l->fx * c[0] + l->cx * c[2];
		m[3 + j] = l->fy * c[1] + l->cy * c[2];
		m[6 + j] = c[2];
	}
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++) {
			int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3,
			    d = (i + 2) % 3;

			h[3 * i + j] =
				m[3 * a + c] * m[3 * b + d] - m[3 * a + d] * m[3 * b + c];
		}
	for (int i = 0; i < 9; i++)
		h[i] /= h[8];
}

void board_scale(const struct incise_board_views *views, const struct board_solution *s,
		 struct incise_board_fit *fit)
{
	double g[BOARD_LENS + BOARD_POSE], middle[2], r[9], sum = 0;
	struct state state = {.lens = s->lens};
	union board_lens u;

	memcpy(state.pose, s->pose[views->plane], sizeof(state.pose));
	for (int i = 0; i < BOARD_LENS; i++)
		u.number[i] = sqrt(fmax(0, cov(s, i, i)));
	fit->u_lens = u.by_name;
	fit->mm_px = axis_scale(views, &state);
	for (int k = 0; k < 2; k++)
		middle[k] = (views->axis_px[0][k] + views->axis_px[1][k]) / 2;
	board_meet(&state.lens, state.pose, middle, middle);
	board_rotation(state.pose, r);
	fit->distance_mm = r[6] * middle[0] + r[7] * middle[1] + state.pose[5];
	gradient(views, s, &state, -1, g);
	fit->part[0] =
		(struct incise_depth_part){"corners, through lens and pose", 'A',
					   sqrt(fmax(0, variance(s, g, g))), "mm/px", 1};
	fit->part[1] = (struct incise_depth_part){"squares of the board", 'B',
						  views->u_square_mm, "mm",
						  fit->mm_px / views->square_mm};
	fit->part[2] = (struct incise_depth_part){"board off the cutting plane", 'B',
						  views->u_plane_mm, "mm",
						  fit->mm_px / fit->distance_mm};
	fit->n_parts = 3;
	for (int i = 0; i < 3; i++)
		sum += pow(fit->part[i].u * fit->part[i].sensitivity, 2);
	fit->u_mm_px = sqrt(sum);
	find_tilt(views, s, &state, fit);
	find_change(views, &state, fit);
	find_residual(views, &state, fit);
	find_homography(&state, fit->homography);
}

void incise_board_plane(const struct incise_board_fit *fit, double x_px, double y_px,
			double mm[2])
{
	union board_lens lens = {.by_name = fit->lens};
	const double px[2] = {x_px, y_px}, *h = fit->homography;
	double ray[2], u[2], w;

	board_undistort(&lens, px, ray);
	u[0] = fit->lens.fx * ray[0] + fit->lens.cx;
	u[1] = fit->lens.fy * ray[1] + fit->lens.cy;
	w = h[6] * u[0] + h[7] * u[1] + h[8];
	mm[0] = (h[0] * u[0] + h[1] * u[1] + h[2]) / w;
	mm[1] = (h[3] * u[0] + h[4] * u[1] + h[5]) / w;
}
