// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lens and poses from views of a board; see incise/calibrate_depth.h.
 *
 *     first values ─ Levenberg and Marquardt ─ views far worse than the rest? ─ covariance
 *                            ▲                        │ yes, without them
 *                            └────────────────────────┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_depth.h>
#include "../base/vector.h"
#include "board_lens.h"
#include "../base/ascending.h"
#include "dense.h"

/* The fitted numbers. */
struct solution {
	union board_lens lens;
	double pose[INCISE_BOARD_VIEWS][BOARD_POSE];
	int n_unknowns;
	double *covariance; /* n_unknowns squared; views left out have none */
	int plane_at;	    /* index of the plane's pose in it */
};

/*
 * --- first values ---
 *
 * After Z. Zhang, A flexible new technique for camera calibration, IEEE PAMI 22 (2000) 1330.
 * Columns 1 and 2 of a homography H = K [r1 r2 t] come from unit vectors at a right angle. With
 * the principal point in the frame's middle, taken off, each view has two equations for
 * w = 1/f²:
 *
 *     w (h11 h12 + h21 h22) + h31 h32 = 0
 *     w (h11² + h21² - h12² - h22²) + h31² - h32² = 0
 */

static void corner_mm(const struct incise_board_views *views, int corner, double mm[2])
{
	mm[0] = corner % views->columns * views->square_mm;
	mm[1] = corner / views->columns * views->square_mm;
}

/*
 * Homography from mm to pixels off the middle. Both are scaled to about 1 (Hartley 1997);
 * the least singular vector of two rows per corner, by their normal matrix.
 */
static void homography(const struct incise_board_views *views, const double *px,
		       double h[9])
{
	double wide = views->square_mm *
		      (views->columns > views->rows ? views->columns : views->rows);
	double large = views->width > views->height ? views->width : views->height;
	double normal[81] = {0}, values[9];

	for (int i = 0; i < views->columns * views->rows; i++) {
		double mm[2], x, y, u, v;

		corner_mm(views, i, mm);
		x = mm[0] / wide;
		y = mm[1] / wide;
		u = (px[2 * i] - views->width / 2.0) / large;
		v = (px[2 * i + 1] - views->height / 2.0) / large;
		double row[2][9] = {{x, y, 1, 0, 0, 0, -u * x, -u * y, -u},
				    {0, 0, 0, x, y, 1, -v * x, -v * y, -v}};

		for (int k = 0; k < 2; k++)
			for (int a = 0; a < 9; a++)
				for (int b = 0; b < 9; b++)
					normal[9 * a + b] += row[k][a] * row[k][b];
	}
	incise_eigen(normal, 9, values);
	for (int i = 0; i < 9; i++)
		h[i] = normal[9 * i] * (i < 6 ? large : 1) / (i % 3 < 2 ? wide : 1);
	/* Before the lens, not behind it. */
	if (h[8] < 0)
		for (int i = 0; i < 9; i++)
			h[i] = -h[i];
}

static int focal_length(double h[][9], int n, double *f)
{
	double top = 0, bottom = 0, w;

	for (int i = 0; i < n; i++) {
		double scale = h[i][0] * h[i][0] + h[i][3] * h[i][3] + h[i][1] * h[i][1] +
			       h[i][4] * h[i][4];
		double a[2] = {h[i][0] * h[i][1] + h[i][3] * h[i][4],
			       h[i][0] * h[i][0] + h[i][3] * h[i][3] - h[i][1] * h[i][1] -
				       h[i][4] * h[i][4]};
		double b[2] = {h[i][6] * h[i][7], h[i][6] * h[i][6] - h[i][7] * h[i][7]};

		for (int k = 0; k < 2; k++) {
			top -= a[k] * b[k] / (scale * scale);
			bottom += a[k] * a[k] / (scale * scale);
		}
	}
	/* (a w + b = 0) has its noise in a too: solved for f² it would be biased the other
	 * way; either is near enough for a start. */
	w = top / bottom;
	if (!(w > 0) || !isfinite(w))
		return -EDOM;
	*f = sqrt(1 / w);
	return 0;
}

static void pose_of(const double h[9], double f, double pose[BOARD_POSE])
{
	double a[3] = {h[0] / f, h[3] / f, h[6]}, b[3] = {h[1] / f, h[4] / f, h[7]};
	double t[3] = {h[2] / f, h[5] / f, h[8]}, c[3], r[9];
	double length = sqrt(sqrt(v3_dot(a, a) * v3_dot(b, b)));

	for (int i = 0; i < 3; i++)
		pose[3 + i] = t[i] / length;
	v3_unit(a, a, 0);
	v3_add(b, b, -v3_dot(a, b), a);
	v3_unit(b, b, 0);
	v3_cross(c, a, b);
	for (int i = 0; i < 3; i++) {
		r[3 * i] = a[i];
		r[3 * i + 1] = b[i];
		r[3 * i + 2] = c[i];
	}
	board_rotation_vector(r, pose);
}

/*
 * First values: a homography of each view, a focal length of all, the principal point in the
 * frame's middle, and no distortion. 0, -EDOM.
 */
static int find_start(const struct incise_board_views *views, struct solution *solution,
		      struct incise_error *err)
{
	int corners = views->columns * views->rows;
	double h[INCISE_BOARD_VIEWS][9], f;

	for (int v = 0; v < views->n; v++)
		homography(views, views->corners + (size_t)2 * corners * v, h[v]);
	if (focal_length(h, views->n, &f))
		return incise_error_set(
			err, EDOM,
			"the views have no common focal length; tilt the board by 20 "
			"to 45 degrees, each time in another direction");
	solution->lens.by_name = (struct incise_board_lens){
		.fx = f,
		.fy = f,
		.cx = views->width / 2.0,
		.cy = views->height / 2.0,
	};
	for (int v = 0; v < views->n; v++)
		pose_of(h[v], f, solution->pose[v]);
	return 0;
}

/*
 * --- the cutting plane ---
 *
 * Every metric of the plane is a function of the lens and of the pose in the plane, 14 numbers;
 * its variance is gᵀ C g with a gradient by differences of a tenth of each number's own standard
 * deviation.
 */

#define GRID 9	       /* places in the region, both ways */
#define AXIS_PLACES 33 /* on the axis */
#define REACH_PX 8.0   /* to both sides of a place; the length of its scale */

struct calibrate_board_state {
	union board_lens lens;
	double pose[BOARD_POSE];
};

static double *number_of_calibrate_board(struct calibrate_board_state *state, int i)
{
	return i < BOARD_LENS ? &state->lens.number[i] : &state->pose[i - BOARD_LENS];
}

static double find_distance(const struct calibrate_board_state *state, const double a[2],
			    const double b[2])
{
	double from[2], to[2];

	board_meet(&state->lens, state->pose, a, from);
	board_meet(&state->lens, state->pose, b, to);
	return hypot(to[0] - from[0], to[1] - from[1]) / hypot(b[0] - a[0], b[1] - a[1]);
}

static double axis_scale(const struct incise_board_views *views,
			 const struct calibrate_board_state *state)
{
	return find_distance(state, views->axis_px[0], views->axis_px[1]);
}

/* Component k of the plane's normal as the camera has it. */
static double normal_of(const struct calibrate_board_state *state, int k)
{
	double r[9];

	board_rotation(state->pose, r);
	return r[3 * k + 2];
}

static double cov(const struct solution *s, int i, int j)
{
	int a = i < BOARD_LENS ? i : s->plane_at + i - BOARD_LENS;
	int b = j < BOARD_LENS ? j : s->plane_at + j - BOARD_LENS;

	return s->covariance[(size_t)a * s->n_unknowns + b];
}

/* One metric. k -1: the scale; 0, 1: the normal's x, y. */
static double metric(const struct incise_board_views *views,
		     const struct calibrate_board_state *state, int k)
{
	return k < 0 ? axis_scale(views, state) : normal_of(state, k);
}

static void gradient(const struct incise_board_views *views, const struct solution *s,
		     const struct calibrate_board_state *state, int k,
		     double g[BOARD_LENS + BOARD_POSE])
{
	struct calibrate_board_state moved = *state;

	for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++) {
		double step = fmax(0.1 * sqrt(fmax(0, cov(s, i, i))), 1e-12);
		double *x = number_of_calibrate_board(&moved, i), was = *x, up, down;

		*x = was + step;
		up = metric(views, &moved, k);
		*x = was - step;
		down = metric(views, &moved, k);
		*x = was;
		g[i] = (up - down) / (2 * step);
	}
}

static double variance(const struct solution *s, const double *g, const double *h)
{
	double sum = 0;

	for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++)
		for (int j = 0; j < BOARD_LENS + BOARD_POSE; j++)
			sum += g[i] * cov(s, i, j) * h[j];
	return sum;
}

static void find_tilt(const struct incise_board_views *views, const struct solution *s,
		      const struct calibrate_board_state *state,
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

/* The range of scales within the region, and the error of a single scale. */
static void find_change(const struct incise_board_views *views,
			const struct calibrate_board_state *state,
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
		scale = find_distance(state, a, b);
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
			  const struct calibrate_board_state *state,
			  struct incise_board_fit *fit)
{
	int corners = views->columns * views->rows;
	const double *px = views->corners + (size_t)2 * corners * views->plane;
	double sum = 0;

	for (int i = 0; i < corners; i++) {
		double mm[2], seen[2], off;

		corner_mm(views, i, mm);
		board_meet(&state->lens, state->pose, px + 2 * i, seen);
		off = hypot(seen[0] - mm[0], seen[1] - mm[1]);
		sum += off * off;
		fit->plane_largest_mm = fmax(fit->plane_largest_mm, off);
	}
	fit->plane_rms_mm = sqrt(sum / corners);
}

/* The inverse of K [r1 r2 t], by cofactors, with its last number 1. */
static void find_homography(const struct calibrate_board_state *state, double h[9])
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

/* Scale, tilt, residual and budget of the plane. */
static void find_scale(const struct incise_board_views *views, const struct solution *s,
		       struct incise_board_fit *fit)
{
	double g[BOARD_LENS + BOARD_POSE], middle[2], r[9], sum = 0;
	struct calibrate_board_state state = {.lens = s->lens};
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
	fit->budget = (struct incise_calibration_budget){
		.n = 3,
		.part =
			{
				{"corners, through lens and pose", 'A',
				 sqrt(fmax(0, variance(s, g, g))), "mm/px", 1},
				{"squares of the board", 'B', views->u_square_mm, "mm",
				 fit->mm_px / views->square_mm},
				{"board off the cutting plane", 'B', views->u_plane_mm,
				 "mm", fit->mm_px / fit->distance_mm},
			},
	};
	for (int i = 0; i < 3; i++) {
		struct incise_calibration_part *part = &fit->budget.part[i];

		part->contribution = part->u * part->sensitivity;
		sum += part->contribution * part->contribution;
	}
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

/* --- the fit --- */

#define ROUNDS 60
#define VIEWS_MIN 3
#define SPREAD_MIN_DEG 10.0 /* views less apart leave the focal length open */
#define RMS_MAX_PX 1.0
/* An outlier among views has so many times the median's residual, and so many px. */
#define VIEW_TIMES 3.0
#define VIEW_PX 0.3

struct board {
	const struct incise_board_views *views;
	int corners, n; /* of a view; unknowns */
	bool *believed;
	int at[INCISE_BOARD_VIEWS];    /* index of a view's pose in the unknowns */
	double *normal, *work, *right; /* n² and n² and n */
};

static const double *corners_of(const struct board *b, int view)
{
	return b->views->corners + (size_t)2 * b->corners * view;
}

/* Sum of squares of a view's residuals, px². */
static double view_power(const struct board *b, const struct solution *s, int view)
{
	const double *px = corners_of(b, view);
	double r[9], sum = 0;

	board_rotation(s->pose[view], r);
	for (int i = 0; i < b->corners; i++) {
		double mm[2], to[2];

		corner_mm(b->views, i, mm);
		board_project(&s->lens, r, s->pose[view] + 3, mm, to);
		sum += (to[0] - px[2 * i]) * (to[0] - px[2 * i]) +
		       (to[1] - px[2 * i + 1]) * (to[1] - px[2 * i + 1]);
	}
	return isfinite(sum) ? sum : HUGE_VAL;
}

static double power(const struct board *b, const struct solution *s)
{
	double sum = 0;

	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v])
			sum += view_power(b, s, v);
	return sum;
}

/* Derivatives of a corner's pixel by the lens and the pose: differences to both sides. */
static void derive(const struct solution *s, int view, const double mm[2],
		   double by[2][BOARD_LENS + BOARD_POSE])
{
	union board_lens lens = s->lens;
	double pose[BOARD_POSE], far = fabs(s->pose[view][5]) + 1, r[9];

	memcpy(pose, s->pose[view], sizeof(pose));
	for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++) {
		double *x = i < BOARD_LENS ? &lens.number[i] : &pose[i - BOARD_LENS];
		double step = i < 4 ? 1e-2 : i < BOARD_LENS + 3 ? 1e-5 : 1e-5 * far;
		double was = *x, to[2][2];

		for (int k = 0; k < 2; k++) {
			*x = was + (k ? step : -step);
			board_rotation(pose, r);
			board_project(&lens, r, pose + 3, mm, to[k]);
		}
		*x = was;
		for (int k = 0; k < 2; k++)
			by[k][i] = (to[1][k] - to[0][k]) / (2 * step);
	}
}

/* Index of a number of the lens or of a view's pose among all unknowns. */
static int unknown(const struct board *b, int view, int i)
{
	return i < BOARD_LENS ? i : b->at[view] + i - BOARD_LENS;
}

/* The normal matrix, whole, and its right side. */
static void accumulate(struct board *b, const struct solution *s)
{
	int n = b->n;

	memset(b->normal, 0, (size_t)n * n * sizeof(*b->normal));
	memset(b->right, 0, n * sizeof(*b->right));
	for (int v = 0; v < b->views->n; v++) {
		const double *px = corners_of(b, v);
		double r[9];

		if (!b->believed[v])
			continue;
		board_rotation(s->pose[v], r);
		for (int c = 0; c < b->corners; c++) {
			double by[2][BOARD_LENS + BOARD_POSE], mm[2], to[2];

			corner_mm(b->views, c, mm);
			board_project(&s->lens, r, s->pose[v] + 3, mm, to);
			derive(s, v, mm, by);
			for (int k = 0; k < 2; k++)
				for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++) {
					int row = unknown(b, v, i);

					b->right[row] +=
						by[k][i] * (px[2 * c + k] - to[k]);
					for (int j = 0; j < BOARD_LENS + BOARD_POSE; j++)
						b->normal[(size_t)row * n +
							  unknown(b, v, j)] +=
							by[k][i] * by[k][j];
				}
		}
	}
}

/* The unit of an unknown in which the normal matrix N has a diagonal of 1. */
static double unit_of_calibrate_board(const struct board *b, int i)
{
	return sqrt(b->normal[(size_t)i * b->n + i]);
}

/* Put N + damping diag N, in these units, into the work matrix. -EDOM where one is 0. */
static int scale_normal(const struct board *b, double damping)
{
	int n = b->n;

	for (int i = 0; i < n; i++) {
		if (!(unit_of_calibrate_board(b, i) > 0))
			return -EDOM;
		for (int j = 0; j < n; j++)
			b->work[(size_t)i * n + j] = b->normal[(size_t)i * n + j] /
						     unit_of_calibrate_board(b, i) /
						     unit_of_calibrate_board(b, j);
		b->work[(size_t)i * n + i] += damping;
	}
	return 0;
}

/* (N + damping diag N) step = right */
static int solve_calibrate_board(const struct board *b, double damping, double *step)
{
	int n = b->n;

	if (scale_normal(b, damping))
		return -EDOM;
	for (int i = 0; i < n; i++)
		step[i] = b->right[i] / unit_of_calibrate_board(b, i);
	if (!incise_cholesky(b->work, n))
		return -EDOM;
	incise_cholesky_solve(b->work, n, step);
	for (int i = 0; i < n; i++)
		step[i] /= unit_of_calibrate_board(b, i);
	return 0;
}

static void go_calibrate_board(const struct board *b, const struct solution *from,
			       const double *step, struct solution *to)
{
	*to = *from;
	for (int i = 0; i < BOARD_LENS; i++)
		to->lens.number[i] += step[i];
	for (int v = 0; v < b->views->n; v++)
		for (int i = 0; i < BOARD_POSE && b->believed[v]; i++)
			to->pose[v][i] += step[b->at[v] + i];
}

static int descend(struct board *b, struct solution *s, double *step)
{
	double damping = 1e-3, now, next;
	struct solution try;

	b->n = BOARD_LENS;
	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v]) {
			b->at[v] = b->n;
			b->n += BOARD_POSE;
		}
	now = power(b, s);
	accumulate(b, s);
	for (int round = 0; round < ROUNDS && damping < 1e10; round++) {
		if (solve_calibrate_board(b, damping, step)) {
			damping *= 10;
			continue;
		}
		go_calibrate_board(b, s, step, &try);
		next = power(b, &try);
		if (!(next < now)) {
			damping *= 10;
			continue;
		}
		*s = try;
		damping = fmax(damping / 10, 1e-12);
		accumulate(b, s);
		if (now - next < 1e-12 * now)
			break;
		now = next;
	}
	return isfinite(now) ? 0 : -EDOM;
}

/* Leave out a view that is far worse than the others; true if there is one. */
static bool leave_calibrate_board_out(struct board *b, const struct solution *s,
				      double *rms)
{
	double sorted[INCISE_BOARD_VIEWS], middle;
	bool any = false;
	int k = 0;

	for (int v = 0; v < b->views->n; v++) {
		rms[v] = sqrt(view_power(b, s, v) / (2 * b->corners));
		if (b->believed[v])
			sorted[k++] = rms[v];
	}
	middle = median(sorted, k);
	/* Only the worst: it may have spoilt the others. */
	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v] && rms[v] == sorted[k - 1] && rms[v] > VIEW_PX &&
		    rms[v] > VIEW_TIMES * middle && k > VIEWS_MIN && !any) {
			b->believed[v] = false;
			any = true;
		}
	return any;
}

static double spread_deg(const struct board *b, const struct solution *s)
{
	double most = 0;

	for (int v = 0; v < b->views->n; v++)
		for (int w = 0; w < v; w++) {
			double a[9], c[9], dot = 0;

			if (!b->believed[v] || !b->believed[w])
				continue;
			board_rotation(s->pose[v], a);
			board_rotation(s->pose[w], c);
			for (int i = 0; i < 3; i++)
				dot += a[3 * i + 2] * c[3 * i + 2];
			most = fmax(most, acos(fmax(-1, fmin(1, dot))));
		}
	return most * 180 / M_PI;
}

static int covariance(struct board *b, struct solution *s, double variance,
		      struct incise_error *err)
{
	int n = b->n;

	accumulate(b, s);
	if (scale_normal(b, 0) || !incise_cholesky(b->work, n))
		return incise_error_set(
			err, EDOM,
			"the views cannot separate lens and poses; tilt the board by "
			"20 to 45 degrees, each time in another direction");
	for (int i = 0; i < n; i++) {
		double *row = s->covariance + (size_t)i * n;

		memset(row, 0, n * sizeof(*row));
		row[i] = variance / unit_of_calibrate_board(b, i);
		incise_cholesky_solve(b->work, n, row);
		for (int j = 0; j < n; j++)
			row[j] /= unit_of_calibrate_board(b, j);
	}
	s->n_unknowns = n;
	s->plane_at = b->at[b->views->plane];
	return 0;
}

static int fit_views(struct board *b, struct solution *s, double *step,
		     struct incise_board_fit *fit, struct incise_error *err)
{
	int rc = find_start(b->views, s, err), equations;
	double sum;

	if (rc)
		return rc;
	do {
		if (descend(b, s, step))
			return incise_error_set(
				err, EDOM,
				"no lens and poses fit the corners; check that all "
				"views are of one board, with corners in the same order");
	} while (leave_calibrate_board_out(b, s, fit->view_rms_px));
	fit->views = 0;
	for (int v = 0; v < b->views->n; v++)
		fit->views += b->believed[v];
	sum = power(b, s);
	equations = 2 * b->corners * fit->views;
	fit->rms_px = sqrt(sum / equations);
	fit->spread_deg = spread_deg(b, s);
	fit->lens = s->lens.by_name;
	if (!b->believed[b->views->plane])
		return incise_error_set(err, EDOM,
					"view %d, in the cutting plane, is an outlier: "
					"residuals of %.2f px, the others %.2f px; "
					"check that the board is flat and the frame "
					"sharp",
					b->views->plane + 1,
					fit->view_rms_px[b->views->plane], fit->rms_px);
	if (fit->rms_px > RMS_MAX_PX)
		return incise_error_set(
			err, EDOM,
			"corners deviate by %.2f px (rms) from a board of %d x %d; "
			"check that it is flat, that it was still, and its sizes",
			fit->rms_px, b->views->columns, b->views->rows);
	if (fit->spread_deg < SPREAD_MIN_DEG)
		return incise_error_set(
			err, EDOM,
			"the views differ by %.1f degrees only; tilt the board by 20 "
			"to 45 degrees, each time in another direction",
			fit->spread_deg);
	rc = covariance(b, s, sum / (equations - b->n), err);
	if (!rc)
		find_scale(b->views, s, fit);
	return rc;
}

static int check_calibrate_board(const struct incise_board_views *v,
				 struct incise_error *err)
{
	size_t numbers;
	double all;

	if (v->columns < 3 || v->rows < 3 || v->columns * v->rows > INCISE_BOARD_CORNERS)
		return incise_error_set(
			err, EINVAL,
			"a board of %d x %d inner corners: expected 3 or more per "
			"side, and at most %d in total",
			v->columns, v->rows, INCISE_BOARD_CORNERS);
	if (v->n < VIEWS_MIN || v->n > INCISE_BOARD_VIEWS)
		return incise_error_set(
			err, EDOM,
			"%d views of the board: expected %d to %d, one in the cutting "
			"plane and the others tilted",
			v->n, VIEWS_MIN, INCISE_BOARD_VIEWS);
	all = v->u_square_mm + v->u_plane_mm + v->square_mm;
	for (int i = 0; i < 4; i++)
		all += v->axis_px[i / 2][i % 2] + v->region_px[i / 2][i % 2];
	if (!(v->square_mm > 0) || !(v->u_square_mm >= 0) || !(v->u_plane_mm >= 0) ||
	    !isfinite(all) || v->plane < 0 || v->plane >= v->n || v->width < 16 ||
	    v->height < 16 ||
	    hypot(v->axis_px[1][0] - v->axis_px[0][0],
		  v->axis_px[1][1] - v->axis_px[0][1]) < 1)
		return incise_error_set(err, EINVAL,
					"sizes of the board, its plane, the axis or "
					"the region are out of range; correct them");
	numbers = (size_t)2 * v->columns * v->rows * v->n;
	for (size_t i = 0; i < numbers; i++)
		if (!(fabs(v->corners[i]) < 1e6))
			return incise_error_set(err, EINVAL,
						"a corner of view %d is at %g, out of "
						"range; remove the view",
						(int)(i / 2 / v->columns / v->rows) + 1,
						v->corners[i]);
	return 0;
}

int incise_calibrate_depth_board(const struct incise_board_views *views,
				 struct incise_board_fit *fit, struct incise_error *err)
{
	struct board b = {.views = views, .corners = views->columns * views->rows};
	struct solution s = {0};
	size_t n = BOARD_LENS + BOARD_POSE * INCISE_BOARD_VIEWS;
	double *step = NULL;
	int rc;

	*fit = (struct incise_board_fit){.mm_px = NAN, .u_mm_px = NAN, .n = views->n};
	rc = check_calibrate_board(views, err);
	if (rc)
		return rc;
	n = BOARD_LENS + BOARD_POSE * views->n;
	b.believed = fit->believed;
	for (int v = 0; v < views->n; v++)
		fit->believed[v] = true;
	b.normal = calloc(n * n, sizeof(*b.normal));
	b.work = calloc(n * n, sizeof(*b.work));
	b.right = calloc(n, sizeof(*b.right));
	s.covariance = calloc(n * n, sizeof(*s.covariance));
	step = calloc(n, sizeof(*step));
	if (b.normal && b.work && b.right && s.covariance && step)
		rc = fit_views(&b, &s, step, fit, err);
	else
		rc = incise_error_set(err, ENOMEM, "out of memory");
	free(b.normal);
	free(b.work);
	free(b.right);
	free(s.covariance);
	free(step);
	return rc;
}
