// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Lens, poses and the scale of the cutting plane from corners whose truth is known: exact
 * corners, stated intervals on 200 random cameras, a view that is wrong, what is refused.
 * The camera here is written apart from lib/calib.
 */
#include "../unit.h"
#include <incise/calibrate_depth.h>
#include "../cases.h"
#include "draws.h"

#define RIGS cases_of(200, 40)
#define VIEWS 7
#define COLUMNS 9
#define ROWS 6
#define SQUARE 5.0

/* Tilts about x and y, a turn about the line of sight, and where the middle is. */
struct pose {
	double tilt_x, tilt_y, turn, at[3];
};

struct camera {
	double fx, fy, cx, cy, k1, k2, p1, p2;
};

struct rig {
	struct camera camera;
	struct pose pose[VIEWS];
	double pitch; /* the true square */
	double px[VIEWS][ROWS][COLUMNS][2];
	struct incise_board_views views;
};

/* Rz(turn) Ry(tilt_y) Rx(tilt_x), step by step. */
static void rotate(const struct pose *p, double v[3])
{
	double x = v[0], y = v[1], z = v[2], t;

	t = y * cos(p->tilt_x) - z * sin(p->tilt_x);
	z = y * sin(p->tilt_x) + z * cos(p->tilt_x);
	y = t;
	t = x * cos(p->tilt_y) + z * sin(p->tilt_y);
	z = -x * sin(p->tilt_y) + z * cos(p->tilt_y);
	x = t;
	v[0] = x * cos(p->turn) - y * sin(p->turn);
	v[1] = x * sin(p->turn) + y * cos(p->turn);
	v[2] = z;
}

static void look(const struct camera *c, const struct pose *p, double x_mm, double y_mm,
		 double px[2])
{
	double v[3] = {x_mm, y_mm, 0}, x, y, r2, radial;

	rotate(p, v);
	x = (v[0] + p->at[0]) / (v[2] + p->at[2]);
	y = (v[1] + p->at[1]) / (v[2] + p->at[2]);
	r2 = x * x + y * y;
	radial = 1 + c->k1 * r2 + c->k2 * r2 * r2;
	px[0] = c->cx +
		c->fx * (x * radial + 2 * c->p1 * x * y + c->p2 * (r2 + 2 * x * x));
	px[1] = c->cy +
		c->fy * (y * radial + c->p1 * (r2 + 2 * y * y) + 2 * c->p2 * x * y);
}

/* The truth: mm between two pixels on the first pose's plane, by Newton's way. */
static void find_mm(const struct rig *rig, const double px[2], double mm[2])
{
	mm[0] = mm[1] = 0;
	for (int round = 0; round < 30; round++) {
		double at[2], dx[2], dy[2], a, b, det, e[2];

		look(&rig->camera, &rig->pose[0], mm[0], mm[1], at);
		look(&rig->camera, &rig->pose[0], mm[0] + 1e-4, mm[1], dx);
		look(&rig->camera, &rig->pose[0], mm[0], mm[1] + 1e-4, dy);
		for (int k = 0; k < 2; k++) {
			dx[k] = (dx[k] - at[k]) / 1e-4;
			dy[k] = (dy[k] - at[k]) / 1e-4;
			e[k] = px[k] - at[k];
		}
		det = dx[0] * dy[1] - dx[1] * dy[0];
		a = (e[0] * dy[1] - e[1] * dy[0]) / det;
		b = (dx[0] * e[1] - dx[1] * e[0]) / det;
		mm[0] += a;
		mm[1] += b;
	}
}

static double true_scale(const struct rig *rig)
{
	const double(*axis)[2] = rig->views.axis_px;
	double a[2], b[2];

	find_mm(rig, axis[0], a);
	find_mm(rig, axis[1], b);
	return hypot(a[0] - b[0], a[1] - b[1]) /
	       hypot(axis[0][0] - axis[1][0], axis[0][1] - axis[1][1]);
}

static void make_rig(struct rig *rig, double noise_px, double u_square)
{
	double f = 900 + 400 * uniform(), far = f * 0.12;

	*rig = (struct rig){
		.camera = {f, f * (1 + 0.002 * normal()), 320 + 8 * normal(),
			   240 + 8 * normal(), -0.15 + 0.1 * uniform(), 0.05 * normal(),
			   0.0005 * normal(), 0.0005 * normal()},
		.pitch = SQUARE + u_square * normal(),
	};
	for (int v = 0; v < VIEWS; v++) {
		/* the first lies nearly as the frame does, the others lean all ways */
		double lean = v ? 0.35 + 0.35 * uniform() : 0.04 * uniform();
		double way = v ? 2 * M_PI * (v + 0.3 * uniform()) / (VIEWS - 1)
			       : 2 * M_PI * uniform();

		rig->pose[v] = (struct pose){lean * cos(way),
					     lean * sin(way),
					     0.2 * normal(),
					     {3 * normal(), 3 * normal(),
					      far * (1 + 0.1 * uniform())}};
		for (int j = 0; j < ROWS; j++)
			for (int i = 0; i < COLUMNS; i++) {
				double *px = rig->px[v][j][i];

				look(&rig->camera, &rig->pose[v],
				     (i - (COLUMNS - 1) / 2.0) * rig->pitch,
				     (j - (ROWS - 1) / 2.0) * rig->pitch, px);
				px[0] += noise_px * normal();
				px[1] += noise_px * normal();
			}
	}
	rig->views = (struct incise_board_views){
		.columns = COLUMNS,
		.rows = ROWS,
		.square_mm = SQUARE,
		.u_square_mm = u_square,
		.corners = &rig->px[0][0][0][0],
		.n = VIEWS,
		.plane = 0,
		.axis_px = {{310, 60}, {330, 440}},
		.region_px = {{220, 60}, {420, 440}},
		.width = 640,
		.height = 480,
	};
}

static void begin(int rig)
{
	seed = 424242 + rig;
	for (int i = 0; i < 10; i++)
		uniform();
}

/* Exact corners give the camera back to what differences of steps leave. */
TEST(test_exact)
{
	for (int n = 1; n <= 20; n++) {
		struct incise_board_fit fit;
		struct rig rig;
		double mm[2], truth[2], corner[2], lean;

		begin(n);
		make_rig(&rig, 0, 0);
		assert_int_equal(incise_calibrate_depth_board(&rig.views, &fit, &err), 0);
		assert_true(fit.rms_px < 1e-6);
		assert_true(fabs(fit.lens.fx / rig.camera.fx - 1) < 1e-6);
		assert_true(fabs(fit.lens.fy / rig.camera.fy - 1) < 1e-6);
		assert_true(fabs(fit.lens.cx - rig.camera.cx) < 1e-3);
		assert_true(fabs(fit.lens.cy - rig.camera.cy) < 1e-3);
		assert_true(fabs(fit.lens.k1 - rig.camera.k1) < 1e-5);
		assert_true(fabs(fit.lens.k2 - rig.camera.k2) < 1e-3);
		assert_true(fabs(fit.lens.p1 - rig.camera.p1) < 1e-6);
		assert_true(fabs(fit.lens.p2 - rig.camera.p2) < 1e-6);
		assert_true(fabs(fit.mm_px / true_scale(&rig) - 1) < 1e-8);
		/* The truth turns about x, then y: cos of the lean is the product. */
		lean = acos(cos(rig.pose[0].tilt_x) * cos(rig.pose[0].tilt_y));
		assert_true(fabs(fit.tilt_deg - lean * 180 / M_PI) < 1e-4);
		assert_true(fit.low_mm_px < fit.mm_px && fit.mm_px < fit.high_mm_px);
		/* The homography: distances on the plane between any two pixels. */
		incise_board_plane(&fit, 100, 100, mm);
		incise_board_plane(&fit, 500, 300, corner);
		find_mm(&rig, (double[]){100, 100}, truth);
		mm[0] -= corner[0];
		mm[1] -= corner[1];
		find_mm(&rig, (double[]){500, 300}, corner);
		assert_true(fabs(hypot(mm[0], mm[1]) -
				 hypot(truth[0] - corner[0], truth[1] - corner[1])) <
			    1e-5);
	}
}

TEST(test_truth)
{
	int held = 0, held_f = 0, held_tilt = 0;
	double worst = 0;

	for (int n = 1; n <= RIGS; n++) {
		struct incise_board_fit fit;
		struct rig rig;
		double truth, lean;

		begin(n);
		make_rig(&rig, 0.05, 0.001);
		assert_int_equal(incise_calibrate_depth_board(&rig.views, &fit, NULL), 0);
		truth = true_scale(&rig);
		held += fabs(fit.mm_px - truth) <= 2 * fit.u_mm_px;
		held_f += fabs(fit.lens.fx - rig.camera.fx) <= 2 * fit.u_lens.fx;
		worst = fmax(worst, fabs(fit.mm_px / truth - 1));
		/* degrees of freedom: of 756 numbers 50 are fitted */
		assert_true(fabs(fit.rms_px - 0.05) < 0.01);
		lean = acos(cos(rig.pose[0].tilt_x) * cos(rig.pose[0].tilt_y)) * 180 /
		       M_PI;
		held_tilt += lean <= fit.tilt_deg + 2 * fit.u_tilt_deg;
	}
	assert_true(cases_hold(held, RIGS, 0.9545));
	assert_true(cases_hold(held_f, RIGS, 0.9545));
	/* a bound to one side: it may hold more */
	assert_true(held_tilt >= 0.9545 * RIGS || cases_hold(held_tilt, RIGS, 0.9545));
	/* the squares' 0.02 % and 0.05 px over 380: 4.5 sd */
	assert_true(worst < 1e-3);
}

/* A view of another board position under the same name: the board slipped. */
TEST(test_wrong_view)
{
	struct incise_board_fit fit;
	struct rig rig;

	begin(1);
	make_rig(&rig, 0.05, 0);
	for (int j = 0; j < ROWS; j++)
		for (int i = 0; i < COLUMNS; i++)
			rig.px[4][j][i][0] += 3 * sin(i * 2.0 + j);
	assert_int_equal(incise_calibrate_depth_board(&rig.views, &fit, &err), 0);
	for (int v = 0; v < VIEWS; v++)
		assert_int_equal(fit.believed[v], v != 4);
	assert_int_equal(fit.views, VIEWS - 1);
	assert_true(fabs(fit.mm_px - true_scale(&rig)) < 4 * fit.u_mm_px);
	/* the same view in the plane is no ground to stand on */
	rig.views.plane = 4;
	assert_error(incise_calibrate_depth_board(&rig.views, &fit, &err), EDOM, &err,
		     "view 5");
}

static void few(struct rig *rig)
{
	rig->views.n = 2;
}

static void one_way(struct rig *rig)
{
	for (int v = 1; v < VIEWS; v++)
		memcpy(rig->px[v], rig->px[0], sizeof(rig->px[0]));
}

static void scattered(struct rig *rig)
{
	for (int v = 0; v < VIEWS; v++)
		for (int j = 0; j < ROWS; j++)
			for (int i = 0; i < COLUMNS; i++)
				rig->px[v][j][i][0] += 8 * normal();
}

static void no_corner(struct rig *rig)
{
	rig->px[2][1][1][0] = NAN;
}

static void no_board(struct rig *rig)
{
	rig->views.columns = 2;
}

static void no_axis(struct rig *rig)
{
	memcpy(rig->views.axis_px[1], rig->views.axis_px[0],
	       sizeof(rig->views.axis_px[0]));
}

static void no_plane(struct rig *rig)
{
	rig->views.plane = VIEWS;
}

static void all_at_one_place(struct rig *rig)
{
	for (size_t i = 0; i < sizeof(rig->px) / sizeof(double); i++)
		(&rig->px[0][0][0][0])[i] = 100;
}

TEST(test_refused)
{
	static const struct {
		void (*spoil)(struct rig *);
		int code;
		const char *text;
	} cases[] = {
		{few, -EDOM, "2 views"},      {one_way, -EDOM, "tilt"},
		{scattered, -EDOM, NULL},     {no_corner, -EINVAL, "view 3"},
		{no_board, -EINVAL, "2 x 6"}, {no_axis, -EINVAL, "axis"},
		{no_plane, -EINVAL, "plane"}, {all_at_one_place, -EDOM, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_board_fit fit;
		struct incise_error err = {0};
		struct rig rig;

		begin(9);
		make_rig(&rig, 0.05, 0);
		cases[i].spoil(&rig);
		assert_int_equal(incise_calibrate_depth_board(&rig.views, &fit, &err),
				 cases[i].code);
		assert_says(err.text, cases[i].text);
		assert_true(*err.text);
	}
}
