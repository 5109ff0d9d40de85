// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lens and poses from views of a board; see incise/calibrate_depth.h and board.h.
 *
 *     first values ─ Levenberg and Marquardt ─ views far worse than the rest? ─ covariance
 *                            ▲                        │ yes, without them
 *                            └────────────────────────┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <lapacke.h>
#include "../base/vector.h"
#include "board.h"
#include "repeats.h"

#define ROUNDS 60
#define VIEWS_MIN 3
#define SPREAD_MIN_DEG 10.0 /* views less apart leave the focal length open */
#define RMS_MAX_PX 1.0
/* A view is an outlier that has so many times the median's residual, and so much. */
#define VIEW_TIMES 3.0
#define VIEW_PX 0.3

struct board {
	const struct incise_board_views *views;
	int corners, n; /* of a view; unknowns */
	bool *believed;
	int at[INCISE_BOARD_VIEWS];    /* where a view's pose begins in the unknowns */
	double *normal, *work, *right; /* n² and n² and n */
};

static const double *corners_of(const struct board *b, int view)
{
	return b->views->corners + (size_t)2 * b->corners * view;
}

/* Sum of squares of a view's residuals, px². */
static double view_power(const struct board *b, const struct board_solution *s, int view)
{
	const double *px = corners_of(b, view);
	double r[9], sum = 0;

	board_rotation(s->pose[view], r);
	for (int i = 0; i < b->corners; i++) {
		double mm[2], to[2];

		board_corner(b->views, i, mm);
		board_project(&s->lens, r, s->pose[view] + 3, mm, to);
		sum += (to[0] - px[2 * i]) * (to[0] - px[2 * i]) +
		       (to[1] - px[2 * i + 1]) * (to[1] - px[2 * i + 1]);
	}
	return isfinite(sum) ? sum : HUGE_VAL;
}

static double power(const struct board *b, const struct board_solution *s)
{
	double sum = 0;

	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v])
			sum += view_power(b, s, v);
	return sum;
}

/* Derivatives of a corner's pixel by the lens and the pose: differences to both sides. */
static void derive(const struct board_solution *s, int view, const double mm[2],
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

/* The normal matrix, whole, and its right side. */
static void accumulate(struct board *b, const struct board_solution *s)
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

			board_corner(b->views, c, mm);
			board_project(&s->lens, r, s->pose[v] + 3, mm, to);
			derive(s, v, mm, by);
			for (int k = 0; k < 2; k++)
				for (int i = 0; i < BOARD_LENS + BOARD_POSE; i++) {
					int row = i < BOARD_LENS
							  ? i
							  : b->at[v] + i - BOARD_LENS;

					b->right[row] +=
						by[k][i] * (px[2 * c + k] - to[k]);
					for (int j = 0; j < BOARD_LENS + BOARD_POSE; j++)
						b->normal
							[(size_t)row * n +
							 (j < BOARD_LENS
								  ? j
								  : b->at[v] + j -
									    BOARD_LENS)] +=
							by[k][i] * by[k][j];
				}
		}
	}
}

/* (N + damping diag N) step = right, in units in which N's diagonal is 1. */
static int solve(const struct board *b, double damping, double *step)
{
	int n = b->n;

	for (int i = 0; i < n; i++) {
		double d = sqrt(b->normal[(size_t)i * n + i]);

		if (!(d > 0))
			return -EDOM;
		step[i] = b->right[i] / d;
		for (int j = 0; j < n; j++)
			b->work[(size_t)i * n + j] = b->normal[(size_t)i * n + j] / d /
						     sqrt(b->normal[(size_t)j * n + j]);
		b->work[(size_t)i * n + i] += damping;
	}
	if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'U', n, 1, b->work, n, step, 1))
		return -EDOM;
	for (int i = 0; i < n; i++)
		step[i] /= sqrt(b->normal[(size_t)i * n + i]);
	return 0;
}

static void go(const struct board *b, const struct board_solution *from,
	       const double *step, struct board_solution *to)
{
	*to = *from;
	for (int i = 0; i < BOARD_LENS; i++)
		to->lens.number[i] += step[i];
	for (int v = 0; v < b->views->n; v++)
		for (int i = 0; i < BOARD_POSE && b->believed[v]; i++)
			to->pose[v][i] += step[b->at[v] + i];
}

static int descend(struct board *b, struct board_solution *s, double *step)
{
	double damping = 1e-3, now, next;
	struct board_solution try;

	b->n = BOARD_LENS;
	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v]) {
			b->at[v] = b->n;
			b->n += BOARD_POSE;
		}
	now = power(b, s);
	accumulate(b, s);
	for (int round = 0; round < ROUNDS && damping < 1e10; round++) {
		if (solve(b, damping, step)) {
			damping *= 10;
			continue;
		}
		go(b, s, step, &try);
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

/* Leaves out views that are far worse. Whether there are any. */
static bool leave_out(struct board *b, const struct board_solution *s, double *rms)
{
	double sorted[INCISE_BOARD_VIEWS], median;
	bool any = false;
	int k = 0;

	for (int v = 0; v < b->views->n; v++) {
		rms[v] = sqrt(view_power(b, s, v) / (2 * b->corners));
		if (b->believed[v])
			sorted[k++] = rms[v];
	}
	median = repeats_median(sorted, k);
	/* The worst one alone: it may have spoilt others. */
	for (int v = 0; v < b->views->n; v++)
		if (b->believed[v] && rms[v] == sorted[k - 1] && rms[v] > VIEW_PX &&
		    rms[v] > VIEW_TIMES * median && k > VIEWS_MIN && !any) {
			b->believed[v] = false;
			any = true;
		}
	return any;
}

static double spread_deg(const struct board *b, const struct board_solution *s)
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

static int covariance(struct board *b, struct board_solution *s, double variance,
		      struct incise_error *err)
{
	int n = b->n;

	accumulate(b, s);
	for (int i = 0; i < n; i++)
		for (int j = 0; j < n; j++)
			b->work[(size_t)i * n + j] = b->normal[(size_t)i * n + j] /
						     sqrt(b->normal[(size_t)i * n + i]) /
						     sqrt(b->normal[(size_t)j * n + j]);
	if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'U', n, b->work, n) ||
	    LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'U', n, b->work, n))
		return incise_error_set(
			err, EDOM,
			"the views do not tell lens and poses apart: tilt "
			"the board by 20 to 45 degrees, each time another "
			"way");
	for (int i = 0; i < n; i++)
		for (int j = 0; j < n; j++)
			s->covariance[(size_t)i * n + j] =
				variance *
				b->work[(size_t)(i < j ? i : j) * n + (i < j ? j : i)] /
				sqrt(b->normal[(size_t)i * n + i]) /
				sqrt(b->normal[(size_t)j * n + j]);
	s->n_unknowns = n;
	s->plane_at = b->at[b->views->plane];
	return 0;
}

static int fit_views(struct board *b, struct board_solution *s, double *step,
		     struct incise_board_fit *fit, struct incise_error *err)
{
	int rc = board_start(b->views, s, err), equations;
	double sum;

	if (rc)
		return rc;
	do {
		if (descend(b, s, step))
			return incise_error_set(
				err, EDOM,
				"lens and poses were not found: are the "
				"corners of one board, in the same order?");
	} while (leave_out(b, s, fit->view_rms_px));
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
					"view %d, which lies in the cutting plane, is an "
					"outlier: %.2f px; the others leave %.2f px: is "
					"the board flat, and the picture sharp?",
					b->views->plane + 1,
					fit->view_rms_px[b->views->plane], fit->rms_px);
	if (fit->rms_px > RMS_MAX_PX)
		return incise_error_set(
			err, EDOM,
			"corners are %.2f px (rms) off a board of %d x %d: "
			"is it flat, was it still, are the sizes right?",
			fit->rms_px, b->views->columns, b->views->rows);
	if (fit->spread_deg < SPREAD_MIN_DEG)
		return incise_error_set(
			err, EDOM,
			"the views are %.1f degrees apart only: tilt the "
			"board by 20 to 45 degrees, each time another way",
			fit->spread_deg);
	rc = covariance(b, s, sum / (equations - b->n), err);
	if (!rc)
		board_scale(b->views, s, fit);
	return rc;
}

static int check(const struct incise_board_views *v, struct incise_error *err)
{
	size_t numbers;
	double all;

	if (v->columns < 3 || v->rows < 3 || v->columns * v->rows > INCISE_BOARD_CORNERS)
		return incise_error_set(
			err, EINVAL,
			"a board of %d x %d inner corners: give 3 or more, "
			"and no more than %d of all",
			v->columns, v->rows, INCISE_BOARD_CORNERS);
	if (v->n < VIEWS_MIN || v->n > INCISE_BOARD_VIEWS)
		return incise_error_set(
			err, EDOM,
			"%d views of the board: give %d to %d, one in the "
			"cutting plane and others tilted",
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
					"sizes of the board, its plane, the axis or the "
					"region are out of range");
	numbers = (size_t)2 * v->columns * v->rows * v->n;
	for (size_t i = 0; i < numbers; i++)
		if (!(fabs(v->corners[i]) < 1e6))
			return incise_error_set(err, EINVAL,
						"a corner of view %d is at %g",
						(int)(i / 2 / v->columns / v->rows) + 1,
						v->corners[i]);
	return 0;
}

int incise_calibrate_depth_board(const struct incise_board_views *views,
				 struct incise_board_fit *fit, struct incise_error *err)
{
	struct board b = {.views = views, .corners = views->columns * views->rows};
	struct board_solution s = {0};
	size_t n = BOARD_LENS + BOARD_POSE * INCISE_BOARD_VIEWS;
	double *step = NULL;
	int rc;

	*fit = (struct incise_board_fit){.mm_px = NAN, .u_mm_px = NAN, .n = views->n};
	rc = check(views, err);
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
