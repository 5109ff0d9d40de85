// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * First values for lens and poses (Z. Zhang, A flexible new technique for camera
 * calibration, IEEE PAMI 22 (2000) 1330); see board.h. Columns 1 and 2 of a homography
 * H = K [r1 r2 t] come from unit vectors at a right angle. With the principal point in the
 * picture's middle, taken off, each view says two things of w = 1/f²:
 *
 *     w (h11 h12 + h21 h22) + h31 h32 = 0
 *     w (h11² + h21² - h12² - h22²) + h31² - h32² = 0
 *
 * A part of one noun: tests/unit/calib/board.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <lapacke.h>
#include "../base/vector.h"
#include "board.h"

/*
 * Homography from mm to pixels off the middle. Both are scaled to about 1 (Hartley 1997);
 * the least singular vector of two rows per corner, by their normal matrix.
 */
static int homography(const struct incise_board_views *views, const double *px,
		      double h[9])
{
	double wide = views->square_mm *
		      (views->columns > views->rows ? views->columns : views->rows);
	double large = views->width > views->height ? views->width : views->height;
	double normal[81] = {0}, values[9];

	for (int i = 0; i < views->columns * views->rows; i++) {
		double mm[2], x, y, u, v;

		board_corner(views, i, mm);
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
	if (LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'V', 'U', 9, normal, 9, values))
		return -EDOM;
	for (int i = 0; i < 9; i++)
		h[i] = normal[9 * i] * (i < 6 ? large : 1) / (i % 3 < 2 ? wide : 1);
	/* Before the lens, not behind it. */
	if (h[8] < 0)
		for (int i = 0; i < 9; i++)
			h[i] = -h[i];
	return 0;
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
	 * way; either is near enough to begin with. */
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
	double along, la, lb;

	for (int i = 0; i < 3; i++)
		pose[3 + i] = t[i] / length;
	la = sqrt(v3_dot(a, a));
	for (int i = 0; i < 3; i++)
		a[i] /= la;
	along = v3_dot(a, b);
	for (int i = 0; i < 3; i++)
		b[i] -= along * a[i];
	lb = sqrt(v3_dot(b, b));
	for (int i = 0; i < 3; i++)
		b[i] /= lb;
	c[0] = a[1] * b[2] - a[2] * b[1];
	c[1] = a[2] * b[0] - a[0] * b[2];
	c[2] = a[0] * b[1] - a[1] * b[0];
	for (int i = 0; i < 3; i++) {
		r[3 * i] = a[i];
		r[3 * i + 1] = b[i];
		r[3 * i + 2] = c[i];
	}
	board_rotation_vector(r, pose);
}

int board_start(const struct incise_board_views *views, struct board_solution *solution,
		struct incise_error *err)
{
	int corners = views->columns * views->rows;
	double h[INCISE_BOARD_VIEWS][9], f;

	for (int v = 0; v < views->n; v++)
		if (homography(views, views->corners + (size_t)2 * corners * v, h[v]))
			return incise_error_set(err, EDOM,
						"view %d has no homography: its corners "
						"do not lie on a board",
						v + 1);
	if (focal_length(h, views->n, &f))
		return incise_error_set(
			err, EDOM,
			"the views have no focal length in common: tilt "
			"the board by 20 to 45 degrees, each time another "
			"way");
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
