// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The fits of incise calibrate depth, and their verdict; see depth.h.
 */
#include <math.h>
#include "depth.h"

#define U_WORST 0.005 /* a larger 2 u, relative, is no calibration */
#define BEND_MM 0.2   /* largest error of one number within a handle's length */
#define BEND_SD 4.0

static void parse_corners(const char *option, const char *text, double to[2][2],
			  double most)
{
	char *items[5];

	if (cli_list(option, (char *)text, items, 5) != 4)
		cli_usage("--%s: expected four numbers: X,Y,X,Y", option);
	for (int i = 0; i < 4; i++)
		to[i / 2][i % 2] = cli_number(option, items[i], 0, most);
}

/* Print the reason and the first outliers. Nothing is changed. */
_Noreturn static void refuse(const struct incise_error *err, const struct depth *depth)
{
	const struct depth_lengths *l = &depth->lengths;
	char names[200] = "";
	size_t length = 0;

	for (int i = 0; depth->fit.inliers && i < l->n && length < sizeof(names) - 60;
	     i++)
		if (!depth->inlier[i])
			length += snprintf(names + length, sizeof(names) - length,
					   "%s%.40s", length ? ", " : " (", l->name[i]);
	cli_fail("%s%s%s", err->text, names, length ? ", …)" : "");
}

static void fit_lengths(struct depth *depth)
{
	const struct depth_lengths *l = &depth->lengths;
	struct incise_calibration_record *record = &depth->common.record;
	const struct incise_depth_fit *fit = &depth->fit;
	bool line = depth->method == DEPTH_LINE;
	const struct incise_depth_lengths pairs = {
		l->mm, l->px, l->n, depth->u_gauge / 100, depth->u_zero_mm};
	const struct incise_depth_points points = {
		.length_mm = depth->length_mm,
		.u_length_mm = depth->u_length_mm,
		.length_px = l->px,
		.n = l->n,
		.u_px = depth->u_px >= 0 ? depth->u_px : l->vision_px,
	};
	struct incise_error err = {0};

	depth->inlier = cli_alloc(l->n, sizeof(*depth->inlier));
	if (line ? incise_calibrate_depth_line(&pairs, depth->inlier, &depth->fit, &err)
		 : incise_calibrate_depth_points(&points, depth->inlier, &depth->fit,
						 &err))
		refuse(&err, depth);
	calibrate_value(&depth->common, "depth_mm_px", "mm/px", fit->mm_px, fit->u_mm_px);
	record->low = line ? (fit->full_px - fit->high_px) * fit->mm_px : NAN;
	record->high = line ? (fit->full_px - fit->low_px) * fit->mm_px : NAN;
	calibrate_words(record->method,
			line ? "straight line through %d of %d pairs, full_px %.3f"
			     : "%d of %d lengths of one known length, full_px %.3f",
			fit->inliers, fit->n, fit->full_px);
	if (line && fit->bend_mm > BEND_MM && fit->bend_mm > BEND_SD * fit->bend_sd_mm) {
		record->pass = false;
		calibrate_words(record->verdict,
				"the pairs lie on a curve: a parabola is %.3f mm off the "
				"line at its ends; turn the camera square to the plane",
				fit->bend_mm);
	}
}

static void place_views(struct depth *depth)
{
	const struct depth_corners *c = &depth->corners;
	struct incise_board_views *views = &depth->views;

	*views = (struct incise_board_views){
		.columns = c->columns,
		.rows = c->rows,
		.square_mm = depth->square_mm,
		.u_square_mm = depth->u_square / 100 * depth->square_mm,
		.corners = c->px,
		.n = c->n,
		.u_plane_mm = depth->u_plane_mm,
		.axis_px = {{c->width / 2.0, c->height * 0.1},
			    {c->width / 2.0, c->height * 0.9}},
		.width = c->width,
		.height = c->height,
	};
	if (depth->axis)
		parse_corners("handle", depth->axis, views->axis_px, 8192);
	for (int k = 0; k < 2; k++) {
		double low = fmin(views->axis_px[0][k], views->axis_px[1][k]);
		double high = fmax(views->axis_px[0][k], views->axis_px[1][k]);

		views->region_px[0][k] = k ? low : low - 100;
		views->region_px[1][k] = k ? high : high + 100;
	}
	if (depth->region)
		parse_corners("region", depth->region, views->region_px, 8192);
}

static int fit_board(struct depth *depth, struct incise_error *err)
{
	struct incise_calibration_record *record = &depth->common.record;
	const struct incise_board_fit *fit = &depth->board;
	int rc;

	place_views(depth);
	rc = incise_calibrate_depth_board(&depth->views, &depth->board, err);
	if (rc)
		return rc;
	calibrate_value(&depth->common, "depth_mm_px", "mm/px", fit->mm_px, fit->u_mm_px);
	calibrate_words(
		record->method,
		"chessboard of %d x %d corners, %d of %d views, tilt at most %.2f degrees",
		depth->corners.columns, depth->corners.rows, fit->views, fit->n,
		fit->tilt_deg + 2 * fit->u_tilt_deg);
	if (fit->bend_mm > BEND_MM) {
		record->pass = false;
		calibrate_words(
			record->verdict,
			"one scale for the whole handle is up to %.3f mm wrong; turn "
			"the camera square to the plane (it is %.1f degrees off)",
			fit->bend_mm, fit->tilt_deg);
	}
	return 0;
}

/* Reasons in this order: data that do not fit the method come first. */
static void set_verdict(struct depth *depth)
{
	struct incise_calibration_record *record = &depth->common.record;
	double scale = record->values[0].left, u = record->values[0].u / scale;
	double off = scale / depth->nominal_mm_px - 1;

	if (!record->pass)
		return;
	record->pass = false;
	if (fabs(off) > depth->tolerance) {
		calibrate_words(
			record->verdict,
			"%+.2f %% from the nominal %g mm/px, more than %g %%; check "
			"length and pixels, or give the scale of your camera with "
			"--nominal",
			100 * off, depth->nominal_mm_px, 100 * depth->tolerance);
	} else if (2 * u > U_WORST) {
		calibrate_words(record->verdict,
				"U is %.2f %% of the scale, more than %.1f %%; give more "
				"readings, or better ones",
				200 * u, 100 * U_WORST);
	} else {
		record->pass = true;
		calibrate_words(
			record->verdict,
			"%+.2f %% from the nominal %g mm/px, within %g %%; U is %.3f %% "
			"of the scale, within %.1f %%",
			100 * off, depth->nominal_mm_px, 100 * depth->tolerance, 200 * u,
			100 * U_WORST);
	}
}

int depth_fit(void *run, struct incise_error *err)
{
	struct depth *depth = run;
	int rc = 0;

	calibrate_words(depth->common.record.range_unit, "mm");
	if (depth->method == DEPTH_BOARD)
		rc = fit_board(depth, err);
	else
		fit_lengths(depth);
	if (!rc)
		set_verdict(depth);
	return rc;
}
