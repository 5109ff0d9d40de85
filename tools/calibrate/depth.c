// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: the scale of the camera's frame in the plane of the scalpel, from
 * two points, a line of pairs, or a board.
 */
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "depth.h"

static const struct cli_unit lengths[] = {
	{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1e3}, {0}};

static void parse_tolerance(void *tolerance, char *text)
{
	*(double *)tolerance = cli_number("tolerance", text, 0.001, 1000) / 100;
}

static void parse_board(void *run, char *text)
{
	struct depth *depth = run;
	char *items[2] = {0};
	char rest;

	if (cli_list("board", text, items, 2) == 2)
		depth->square_mm = cli_quantity("--board", items[1], lengths, 0.01, 1000);
	if (sscanf(items[0], "%dx%d%c", &depth->corners.columns, &depth->corners.rows,
		   &rest) != 2 ||
	    depth->corners.columns < 3 || depth->corners.rows < 3 ||
	    depth->corners.columns > 100 || depth->corners.rows > 100 ||
	    depth->corners.columns * depth->corners.rows > INCISE_BOARD_CORNERS)
		cli_usage(
			"--board: expected inner corners such as 9x6, 3 or more each way "
			"and at most %d together, found '%s'",
			INCISE_BOARD_CORNERS, items[0]);
}

static void parse_u(void *run, char *text)
{
	static const struct cli_option keys[] = {
		{0, "given-u length", "LENGTH", NULL,
		 CLI_QUANTITY(struct depth, u_length_mm, lengths, 0, 100)},
		{0, "given-u pixels", "PX", NULL,
		 CLI_NUMBER(struct depth, u_px, 0, 1000)},
		{0, "given-u gauge", "PERCENT", NULL,
		 CLI_NUMBER(struct depth, u_gauge, 0, 100)},
		{0, "given-u zero", "LENGTH", NULL,
		 CLI_QUANTITY(struct depth, u_zero_mm, lengths, 0, 100)},
		{0, "given-u square", "PERCENT", NULL,
		 CLI_NUMBER(struct depth, u_square, 0, 100)},
		{0, "given-u plane", "LENGTH", NULL,
		 CLI_QUANTITY(struct depth, u_plane_mm, lengths, 0, 100)},
		{0},
	};

	cli_keys(text, keys, run);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct depth),
	{0, "from", "FILE",
	 "images (more may follow), FILE.csv or NAME.rec instead of the rig's "
	 "camera",
	 CLI_INPUT(struct depth, common.from)},
	{'o', "output", "FILE.csv", "write the raw data as CSV, for --from",
	 CLI_OUTPUT(struct depth, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct depth),
	{0, "nominal", "MM_PX", "nominal scale to compare with (default: 0.11875)",
	 CLI_NUMBER(struct depth, nominal_mm_px, 1e-4, 10)},
	{0, "tolerance", "PERCENT", "largest deviation from it that passes (default: 5)",
	 CLI_PARSED(struct depth, tolerance, parse_tolerance)},
	{0, "length", "LENGTH", "two-point: known length (default: 47.5mm)",
	 CLI_QUANTITY(struct depth, length_mm, lengths, 0.1, 1000)},
	{0, "pixels", "PX,...", "two-point: the length in pixels, one value or more",
	 CLI_TEXT(struct depth, pixels)},
	{0, "images", "N",
	 "number of frames to take from the camera (default: 50 on a terminal, 8 "
	 "of a board)",
	 CLI_INTEGER(struct depth, pictures, 1, DEPTH_FILES_MAX)},
	{0, "every", "TIME", "board: time between two frames, without a terminal",
	 CLI_DURATION(struct depth, every_s, 0.01, 3600)},
	{0, "pick", "X,Y", "learn the colour of the handle from this pixel",
	 CLI_TEXT(struct depth, pick)},
	{0, "board", "COLSxROWS[,LENGTH]",
	 "board: inner corners and side of a square (default: 9x6,5mm)",
	 CLI_PARSED_BY(parse_board)},
	{0, "handle", "X,Y,X,Y",
	 "board: ends of the handle in the image (default: upright in its middle)",
	 CLI_TEXT(struct depth, axis)},
	{0, "region", "X,Y,X,Y",
	 "board: corners of the region of interest (default: 100 px around the "
	 "axis)",
	 CLI_TEXT(struct depth, region)},
	{0, "given-u", "KEY=VALUE,...",
	 "standard uncertainties: two-point: length (default: 0.012mm) and pixels, "
	 "common to all (default: 0.7 for --pixels, 0.03 from images); line: gauge, "
	 "of its scale in percent (default: 0.05), and zero (default: 0.02mm); "
	 "board: square, in percent (default: 0.02), and plane, of its distance "
	 "from the cutting plane (default: 0.1mm)",
	 CLI_PARSED_BY(parse_u)},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate depth",
	.synopsis = "two-point | line | board [OPTIONS]",
	.summary =
		"Measure the scale of the camera's image in the plane of the scalpel, "
		"and write it to calibration.conf, by one of three methods.\n"
		"  two-point  a known length and its length in pixels\n"
		"  line       many pairs of a depth, from a gauge or the tracker, and an "
		"exposed length\n"
		"  board      a chessboard in the cutting plane, and tilted",
	.options = option_table,
	.examples =
		"incise calibrate depth two-point --length 47.5mm --pixels 400\n"
		"incise calibrate depth board --from plane.png tilt*.png --board 9x6,5mm",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

static const char *const methods[] = {"two-point", "line", "board", NULL};

static void parse_files(struct depth *depth, int argc, char **argv)
{
	if (!depth->common.from && optind < argc)
		cli_usage("unexpected argument '%s'; images are given with --from",
			  argv[optind]);
	if (!depth->common.from)
		return;
	depth->path = cli_alloc(argc - optind + 1, sizeof(*depth->path));
	depth->path[depth->n_paths++] = (char *)depth->common.from;
	while (optind < argc)
		depth->path[depth->n_paths++] = argv[optind++];
	for (int i = 0; i < depth->n_paths && depth->n_paths > 1; i++)
		if (depth_is_csv(depth->path[i]) || depth_is_recording(depth->path[i]))
			cli_usage("unexpected argument '%s'; give one CSV file or "
				  "recording at a time",
				  depth->path[i]);
}

static void check_depth_options(void *run, int argc, char **argv)
{
	struct depth *depth = run;
	const char *method;

	if (optind == argc)
		cli_usage("missing method: two-point, line or board");
	method = argv[optind++];
	while (methods[depth->method] && strcmp(method, methods[depth->method]))
		depth->method++;
	if (!methods[depth->method])
		cli_usage("unknown method '%s'; expected two-point, line or board",
			  method);
	parse_files(depth, argc, argv);
	depth->guided = !depth->n_paths && isatty(STDIN_FILENO);
	if (depth->pixels && (depth->common.from || depth->method != DEPTH_TWO_POINT))
		cli_usage("--pixels goes with two-point, and without --from");
	cli_catch_signals();
}

/* --- the fit ------------------------------------------------------------------------- */

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
_Noreturn static void fail_with_outliers(const struct incise_error *err,
					 const struct depth *depth)
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
		fail_with_outliers(&err, depth);
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

static int fit_depth(void *run, struct incise_error *err)
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
/* --- the report ---------------------------------------------------------------------- */

#define OUTLIERS_SHOWN 20

static const struct incise_calibration_budget *budget_of(const struct depth *r)
{
	return r->method == DEPTH_BOARD ? &r->board.budget : &r->fit.budget;
}

static double residual_mm(const struct depth *r, int i)
{
	const struct incise_depth_fit *fit = &r->fit;

	if (r->method == DEPTH_LINE)
		return r->lengths.mm[i] - fit->mm_px * (fit->full_px - r->lengths.px[i]);
	return (r->lengths.px[i] - fit->full_px) * fit->mm_px;
}

static void print_budget(const struct depth *r, FILE *out)
{
	double value = r->common.record.values[0].left, u = r->common.record.values[0].u;
	const struct incise_calibration_budget *budget = budget_of(r);

	fprintf(out, "\n%-36s type  %-18s %-14s contribution\n", "budget of depth_mm_px",
		"u", "sensitivity");
	for (int i = 0; i < budget->n; i++) {
		const struct incise_calibration_part *part = &budget->part[i];
		char text[40];

		snprintf(text, sizeof(text), "%.3g %s", part->u, part->unit);
		fprintf(out, "%-36s %c     %-18s %-14.4g %.3g mm/px\n", part->source,
			part->type, text, part->sensitivity, fabs(part->contribution));
	}
	fprintf(out, "%-36s       %-18s %-14s %.3g mm/px (%.3f %%)\n", "together", "", "",
		u, 100 * u / value);
}

static void print_lengths(const struct depth *r, FILE *out)
{
	const struct incise_depth_fit *fit = &r->fit;
	int shown = 0;

	fprintf(out, "full_px        %.3f, u %.3f\n", fit->full_px, fit->u_full_px);
	fprintf(out, "readings       %d (%d accepted, effective n = %d)\n", fit->n,
		fit->inliers, fit->effective);
	if (isfinite(fit->sd_mm))
		fprintf(out, "residuals      sd %.4f mm, largest %.4f mm\n", fit->sd_mm,
			fit->largest_mm);
	if (isfinite(fit->bend_mm))
		fprintf(out,
			"bend           %.4f mm, u %.4f mm: difference of a parabola "
			"at the ends\n",
			fit->bend_mm, fit->bend_sd_mm);
	fprintf(out, "range          %.1f to %.1f px\n", fit->low_px, fit->high_px);
	for (int i = 0; i < fit->n; i++)
		if (!r->inlier[i] && shown++ < OUTLIERS_SHOWN)
			fprintf(out, "outlier        %s: %.2f px%s\n", r->lengths.name[i],
				r->lengths.px[i],
				r->method == DEPTH_LINE &&
						r->lengths.mm[i] > r->lengths.px[i]
					? "; the columns may be swapped"
					: "");
	if (shown > OUTLIERS_SHOWN)
		fprintf(out, "outliers       %d more\n", shown - OUTLIERS_SHOWN);
}

static void print_board(const struct depth *r, FILE *out)
{
	const struct incise_board_fit *b = &r->board;
	const struct incise_board_lens *l = &b->lens, *u = &b->u_lens;

	fprintf(out, "views          %d (%d accepted), %.1f degrees apart\n", b->n,
		b->views, b->spread_deg);
	fprintf(out,
		"corners        %.3f px (rms) off the board; in the plane %.4f mm, "
		"largest %.4f mm\n",
		b->rms_px, b->plane_rms_mm, b->plane_largest_mm);
	fprintf(out,
		"lens           fx %.2f (u %.2f), fy %.2f (u %.2f), cx %.2f (u %.2f), "
		"cy %.2f (u %.2f) px\n",
		l->fx, u->fx, l->fy, u->fy, l->cx, u->cx, l->cy, u->cy);
	fprintf(out,
		"distortion     k1 %.4f (u %.4f), k2 %.4f (u %.4f), p1 %.5f (u %.5f), "
		"p2 %.5f (u %.5f)\n",
		l->k1, u->k1, l->k2, u->k2, l->p1, u->p1, l->p2, u->p2);
	fprintf(out,
		"plane          tilted by %.2f degrees, at most %.2f (k = 2); %.0f mm "
		"away\n",
		b->tilt_deg, b->tilt_deg + 2 * b->u_tilt_deg, b->distance_mm);
	fprintf(out, "region         %.6f to %.6f mm/px along the handle\n", b->low_mm_px,
		b->high_mm_px);
	fprintf(out, "one scale      is off by up to %.4f mm along the handle\n",
		b->bend_mm);
	fprintf(out, "homography     [%.6g %.6g %.6g; %.6g %.6g %.6g; %.6g %.6g %.6g]\n",
		b->homography[0], b->homography[1], b->homography[2], b->homography[3],
		b->homography[4], b->homography[5], b->homography[6], b->homography[7],
		b->homography[8]);
	for (int v = 0; v < b->n; v++)
		if (!b->believed[v])
			fprintf(out, "outlier        view %s: %.2f px\n",
				r->corners.name[v], b->view_rms_px[v]);
}

static void print_vision(const struct depth *r, FILE *out)
{
	const struct incise_vision_setup *s = &r->setup;

	if (r->method == DEPTH_BOARD || !r->found_setup)
		return;
	fprintf(out,
		"\nfor rig.conf:\nvision = {\n\thue = [%d, %d];\n\tsaturation = [%d, %d];\n"
		"\tvalue = [%d, %d];\n\tfull_px = %.3f;\n};\n",
		s->hue[0], s->hue[1], s->saturation[0], s->saturation[1], s->value[0],
		s->value[1], r->fit.full_px);
}

static void print_depth_report(const void *run, FILE *out)
{
	const struct depth *r = run;

	fprintf(out, "method         %s\n", r->common.record.method);
	if (r->method == DEPTH_BOARD)
		print_board(r, out);
	else
		print_lengths(r, out);
	print_budget(r, out);
	print_vision(r, out);
}

/* --- JSON ---------------------------------------------------------------------------- */

static void add_lengths_json(const struct depth *r, json_t *object)
{
	const struct incise_depth_fit *fit = &r->fit;
	json_t *outliers = json_array();

	json_set_number(object, "full_px", fit->full_px);
	json_set_number(object, "full_u_px", fit->u_full_px);
	json_set_integer(object, "readings", fit->n);
	json_set_integer(object, "inliers", fit->inliers);
	json_set_integer(object, "effective", fit->effective);
	json_set_number(object, "residual_sd_mm", fit->sd_mm);
	json_set_number(object, "residual_max_mm", fit->largest_mm);
	json_set_number(object, "bend_mm", fit->bend_mm);
	json_set_number(object, "bend_u_mm", fit->bend_sd_mm);
	for (int i = 0; i < fit->n; i++)
		if (!r->inlier[i])
			json_array_append_new(outliers, json_text(r->lengths.name[i]));
	json_object_set_new(object, "outliers", outliers);
	if (r->found_setup) {
		const struct incise_vision_setup *s = &r->setup;

		json_object_set_new(object, "vision",
				    json_pack("{s[ii]s[ii]s[ii]}", "hue", s->hue[0],
					      s->hue[1], "saturation", s->saturation[0],
					      s->saturation[1], "value", s->value[0],
					      s->value[1]));
	}
}

static void add_board_json(const struct depth *r, json_t *object)
{
	const struct incise_board_fit *b = &r->board;
	json_t *lens = json_object(), *outliers = json_array();

	json_set_number(lens, "fx_px", b->lens.fx);
	json_set_number(lens, "fy_px", b->lens.fy);
	json_set_number(lens, "cx_px", b->lens.cx);
	json_set_number(lens, "cy_px", b->lens.cy);
	json_set_number(lens, "k1", b->lens.k1);
	json_set_number(lens, "k2", b->lens.k2);
	json_set_number(lens, "p1", b->lens.p1);
	json_set_number(lens, "p2", b->lens.p2);
	json_object_set_new(object, "lens", lens);
	json_object_set_new(object, "homography", json_numbers(b->homography, 9));
	json_set_integer(object, "views", b->n);
	json_set_integer(object, "inliers", b->views);
	json_set_number(object, "rms_error_px", b->rms_px);
	json_set_number(object, "plane_rms_error_mm", b->plane_rms_mm);
	json_set_number(object, "plane_max_mm", b->plane_largest_mm);
	json_set_number(object, "tilt_deg", b->tilt_deg);
	json_set_number(object, "tilt_bound_deg", b->tilt_deg + 2 * b->u_tilt_deg);
	json_set_number(object, "distance_mm", b->distance_mm);
	json_set_number(object, "spread_deg", b->spread_deg);
	json_set_number(object, "low_mm_px", b->low_mm_px);
	json_set_number(object, "high_mm_px", b->high_mm_px);
	json_set_number(object, "bend_mm", b->bend_mm);
	for (int v = 0; v < b->n; v++)
		if (!b->believed[v])
			json_array_append_new(outliers, json_text(r->corners.name[v]));
	json_object_set_new(object, "outliers", outliers);
}

static json_t *make_depth_json(const void *run)
{
	const struct depth *r = run;
	const struct incise_calibration_value *value = &r->common.record.values[0];
	json_t *object = json_object(), *list = json_array();
	const struct incise_calibration_budget *budget = budget_of(r);

	json_object_set_new(object, "way", json_string(methods[r->method]));
	json_object_set_new(object, "pass", json_boolean(r->common.record.pass));
	json_object_set_new(object, "in_force",
			    json_boolean(r->common.record.pass && !r->common.dry_run));
	json_object_set_new(object, "verdict", json_text(r->common.record.verdict));
	json_set_number(object, "depth_mm_px", value->left);
	json_set_number(object, "u_mm_px", value->u);
	json_set_number(object, "U_mm_px", 2 * value->u);
	json_set_number(object, "found_mm_px", value->found);
	for (int i = 0; i < budget->n; i++) {
		const struct incise_calibration_part *part = &budget->part[i];

		json_array_append_new(list, json_pack("{ss ss# ss so so}", "name",
						      part->source, "type", &part->type,
						      1, "unit", part->unit, "u",
						      json_number(part->u), "sensitivity",
						      json_number(part->sensitivity)));
	}
	json_object_set_new(object, "budget", list);
	if (r->method == DEPTH_BOARD)
		add_board_json(r, object);
	else
		add_lengths_json(r, object);
	return object;
}

/* --- folder -------------------------------------------------------------------------- */

static void put_lengths(const struct depth *r, FILE *data)
{
	for (int i = 0; i < r->fit.n; i++)
		fprintf(data, "%d %.5f %.6f %.6f %d\n", i + 1, r->lengths.px[i],
			r->lengths.mm[i], residual_mm(r, i), r->inlier[i]);
}

/* Corners and their residuals, without the rotation and translation of the board's own frame. */
static void put_corners(const struct depth *r, FILE *data)
{
	const struct incise_board_views *v = &r->views;
	const int corners = v->columns * v->rows;
	const double *px = v->corners + (size_t)2 * corners * v->plane;
	double complex board[INCISE_BOARD_CORNERS], seen[INCISE_BOARD_CORNERS];
	double complex middle = 0, mean = 0, turn = 0;

	for (int i = 0; i < corners; i++) {
		double at[2];

		incise_board_plane(&r->board, px[2 * i], px[2 * i + 1], at);
		seen[i] = at[0] + at[1] * I;
		board[i] = i % v->columns + i / v->columns * I;
		mean += seen[i] / corners;
		middle += board[i] / corners;
	}
	for (int i = 0; i < corners; i++) {
		seen[i] -= mean;
		board[i] = (board[i] - middle) * v->square_mm;
		turn += conj(seen[i]) * board[i];
	}
	turn /= cabs(turn);
	for (int i = 0; i < corners; i++) {
		double complex off = seen[i] * turn - board[i];

		fprintf(data, "%.3f %.3f %.5f %.5f %.5f %.5f\n", px[2 * i], px[2 * i + 1],
			creal(board[i]), cimag(board[i]), creal(off), cimag(off));
	}
}

static void draw_fit(const struct depth *r, bool line, bool outliers, FILE *script)
{
	const char *columns = line ? "2:($5 > 0 ? $3 : NaN)" : "1:($5 > 0 ? $2 : NaN)";
	const char *others = line ? "2:($5 > 0 ? NaN : $3)" : "1:($5 > 0 ? NaN : $2)";
	int n = 0;

	if (r->method == DEPTH_BOARD) {
		fputs("set title 'Corners of the board in the frame of its plane'\n"
		      "set xlabel 'x / px'\nset ylabel 'y / px'\n"
		      "set yrange [*:*] reverse\nset size ratio -1\n"
		      "plot 'depth.dat' using 1:2 with points lt 1\n",
		      script);
		return;
	}
	fprintf(script,
		"set title '%s'\nset xlabel '%s'\nset ylabel '%s'\neval key_below\n",
		line ? "Depth over the exposed length"
		     : "Exposed length in the air, reading by reading",
		line ? "exposed length / px" : "number of the reading",
		line ? "depth / mm" : "exposed length / px");
	plot_add(script, &n, "'depth.dat' using %s with points lt 1 title '%s'", columns,
		 line ? "pairs" : "readings");
	if (outliers)
		plot_add(script, &n,
			 "'depth.dat' using %s with points lt 2 pt 2 title 'outliers'",
			 others);
	if (line)
		plot_add(script, &n, "%.12g * (%.12g - x) lt 3 title 'fit'", r->fit.mm_px,
			 r->fit.full_px);
	else
		plot_add(script, &n, "%.12g lt 3 title 'mean'", r->fit.full_px);
	fputc('\n', script);
}

static void draw_depth_plots(const void *run, const char *folder)
{
	const struct depth *r = run;
	FILE *script, *data = plot_data(folder, "depth.dat");
	bool line = r->method == DEPTH_LINE, board = r->method == DEPTH_BOARD;
	bool outliers = false;

	if (board)
		put_corners(r, data);
	else
		put_lengths(r, data);
	plot_data_end(data, folder);
	for (int i = 0; !board && i < r->fit.n; i++)
		outliers |= !r->inlier[i];
	script = plot_begin(folder, "fit", 900, 560);
	draw_fit(r, line, outliers, script);
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	if (!board)
		fprintf(script,
			"set title 'Residuals of the fit, without outliers'\n"
			"set xlabel '%s'\nset ylabel 'residual of the depth / mm'\n"
			"plot 'depth.dat' using %d:($5 > 0 ? $4 : NaN) with points lt 1, "
			"0 lt 3 lw 1\n",
			line ? "exposed length / px" : "number of the reading",
			line ? 2 : 1);
	else
		fputs("set title 'Residuals of the corners in the plane, 100 times as large'\n"
		      "set xlabel 'x on the board / mm'\nset ylabel 'y on the board / mm'\n"
		      "set size ratio -1\n"
		      "plot 'depth.dat' using 3:4:($5 * 100):($6 * 100) with vectors lt 1\n",
		      script);
	calibrate_draw(script, folder, "residuals");
}

int calibrate_depth(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "depth",
		.command = &command,
		.check = check_depth_options,
		.read = depth_read,
		.measure = depth_measure,
		.write = depth_write,
		.fit = fit_depth,
		.text = print_depth_report,
		.summary = print_depth_report,
		.json = make_depth_json,
		.draw = draw_depth_plots,
	};
	struct incise_calibration nominal;
	static struct depth depth = {
		/* As for force: a larger deviation is more often an error. */
		.tolerance = 0.05,
		.length_mm = 47.5, /* paper 1, §2 */
		/* A caliper that is right to 0.02 mm: that over √3. */
		.u_length_mm = 0.012,
		.u_px = -1,
		.u_gauge = 0.05, /* % */
		.u_zero_mm = 0.02,
		.corners = {.columns = 9, .rows = 6},
		.square_mm = 5,
		.u_square = 0.02, /* % */
		.u_plane_mm = 0.1,
	};

	incise_calibration_nominal(&nominal);
	depth.nominal_mm_px = nominal.depth_mm_px;
	return calibrate_run(&kind, argc, argv, &depth);
}
