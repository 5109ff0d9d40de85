// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: the scale of the camera's picture in the plane of the scalpel, from
 * two points, a line of pairs, or a board.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "calibrate/calibrate.h"
#include "calibrate/depth.h"
#include "cli/json.h"

#define LENGTH_MM 47.5	  /* paper 1, §2 */
#define U_LENGTH_MM 0.012 /* a caliper that is right to 0.02 mm: that over √3 */
#define U_GAUGE 0.05	  /* % */
#define U_ZERO_MM 0.02
#define U_SQUARE 0.02 /* % */
#define U_PLANE_MM 0.1
#define TOLERANCE 0.05 /* as for force: a larger deviation is more often an error */

#define U_CLICKS_PX 0.7 /* two ends, half a pixel each */
#define U_WORST 0.005	/* a larger 2 u, relative, is no calibration */
#define BEND_MM 0.2	/* largest error of one number within a handle's length */
#define BEND_SD 4.0
#define FILES_MAX 1000

struct options {
	struct calibrate_options common;
	const char *way; /* two-point, line, board */
	double length_mm, u_length_mm, u_px, u_gauge, u_zero_mm;
	const char *pixels, *axis, *region;
	int columns, rows;
	double square_mm, u_square, u_plane_mm;
	double nominal_mm_px, tolerance;
	struct depth_source source;
};

static const struct cli_unit lengths[] = {
	{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1e3}, {0}};

static void parse_tolerance(void *tolerance, char *text)
{
	*(double *)tolerance = cli_number("tolerance", text, 0.001, 1000) / 100;
}

static void parse_board(void *whole, char *text)
{
	struct options *options = whole;
	char rest;

	if (sscanf(text, "%dx%d%c", &options->columns, &options->rows, &rest) != 2 ||
	    options->columns < 3 || options->rows < 3 || options->columns > 100 ||
	    options->rows > 100 ||
	    options->columns * options->rows > INCISE_BOARD_CORNERS)
		cli_usage(
			"--board: expected inner corners such as 9x6, 3 or more each way "
			"and at most %d together, found '%s'",
			INCISE_BOARD_CORNERS, text);
}

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct options, common.rig)},
	{CALIBRATE_FILE_OPTION(struct options)},
	{0, "from", "FILE",
	 "images (more may follow), FILE.csv or NAME.rec instead of the rig's "
	 "camera",
	 CLI_INPUT(struct options, common.from)},
	{0, "keep", "FILE", "write the raw data to this file, for --from",
	 CLI_OUTPUT(struct options, common.keep), .extensions = ".csv"},
	{0, "report", "DIR",
	 "write report.txt, report.json, fit.png and residuals.png into this "
	 "folder",
	 CLI_OUTPUTS(struct options, common.report)},
	{0, "dry-run", NULL, "do everything except writing calibration.conf",
	 CLI_FLAG(struct options, common.dry_run)},
	{0, "json", NULL, "report as one JSON object",
	 CLI_FLAG(struct options, common.json)},
	{0, "nominal", "MM_PX", "nominal scale to compare with (default: 0.11875)",
	 CLI_NUMBER(struct options, nominal_mm_px, 1e-4, 10)},
	{0, "tolerance", "PERCENT", "largest deviation from it that passes (default: 5)",
	 CLI_PARSED(struct options, tolerance, parse_tolerance)},
	{0, "length", "LENGTH", "two-point: known length (default: 47.5mm)",
	 CLI_QUANTITY(struct options, length_mm, lengths, 0.1, 1000)},
	{0, "length-u", "LENGTH",
	 "two-point: its standard uncertainty (default: 0.012mm)",
	 CLI_QUANTITY(struct options, u_length_mm, lengths, 0, 100)},
	{0, "pixels", "PX,...", "two-point: the length in pixels, one value or more",
	 CLI_TEXT(struct options, pixels)},
	{0, "pixels-u", "PX",
	 "two-point: standard uncertainty common to all lengths (default: 0.7 for "
	 "--pixels, 0.03 from images)",
	 CLI_NUMBER(struct options, u_px, 0, 1000)},
	{0, "images", "N",
	 "number of frames to take from the camera (default: 50 on a terminal, 8 "
	 "of a board)",
	 CLI_INTEGER(struct options, source.pictures, 1, FILES_MAX)},
	{0, "every", "TIME", "board: time between two frames, without a terminal",
	 CLI_DURATION(struct options, source.every_s, 0.01, 3600)},
	{0, "pick", "X,Y", "learn the colour of the handle from this pixel",
	 CLI_TEXT(struct options, source.pick)},
	{0, "gauge-u", "PERCENT",
	 "line: standard uncertainty of the scale of the depth gauge (default: "
	 "0.05)",
	 CLI_NUMBER(struct options, u_gauge, 0, 100)},
	{0, "zero-u", "LENGTH",
	 "line: standard uncertainty of its zero (default: 0.02mm)",
	 CLI_QUANTITY(struct options, u_zero_mm, lengths, 0, 100)},
	{0, "board", "COLSxROWS", "board: inner corners (default: 9x6)",
	 CLI_PARSED_BY(parse_board)},
	{0, "square", "LENGTH", "board: side of a square (default: 5mm)",
	 CLI_QUANTITY(struct options, square_mm, lengths, 0.01, 1000)},
	{0, "square-u", "PERCENT",
	 "board: standard uncertainty of the squares (default: 0.02)",
	 CLI_NUMBER(struct options, u_square, 0, 100)},
	{0, "plane-u", "LENGTH",
	 "board: standard uncertainty of its distance from the cutting plane "
	 "(default: 0.1mm)",
	 CLI_QUANTITY(struct options, u_plane_mm, lengths, 0, 100)},
	{0, "handle", "X,Y,X,Y",
	 "board: ends of the handle in the image (default: upright in its middle)",
	 CLI_TEXT(struct options, axis)},
	{0, "region", "X,Y,X,Y",
	 "board: corners of the region of interest (default: 100 px around the "
	 "axis)",
	 CLI_TEXT(struct options, region)},
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
		"incise calibrate depth board --from plane.png tilt*.png --square 5mm",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

static void parse_files(struct options *options, int argc, char **argv)
{
	struct depth_source *source = &options->source;

	if (!options->common.from && optind < argc)
		cli_usage("unexpected argument '%s'; images are given with --from",
			  argv[optind]);
	if (!options->common.from)
		return;
	source->path = cli_alloc(argc - optind + 1, sizeof(*source->path));
	source->path[source->n_paths++] = (char *)options->common.from;
	while (optind < argc)
		source->path[source->n_paths++] = argv[optind++];
	if (source->n_paths > 1)
		for (int i = 0; i < source->n_paths; i++)
			if (depth_is_csv(source->path[i]) ||
			    depth_is_recording(source->path[i]))
				cli_usage("unexpected argument '%s'; give one CSV file "
					  "or recording at a time",
					  source->path[i]);
}

static void parse(struct options *options, int argc, char **argv)
{
	struct incise_calibration nominal;

	incise_calibration_nominal(&nominal);
	*options = (struct options){
		.nominal_mm_px = nominal.depth_mm_px,
		.tolerance = TOLERANCE,
		.length_mm = LENGTH_MM,
		.u_length_mm = U_LENGTH_MM,
		.u_px = -1,
		.u_gauge = U_GAUGE,
		.u_zero_mm = U_ZERO_MM,
		.columns = 9,
		.rows = 6,
		.square_mm = 5,
		.u_square = U_SQUARE,
		.u_plane_mm = U_PLANE_MM,
	};
	cli_parse(&command, argc, argv, options);
	if (optind == argc)
		cli_usage("missing method: two-point, line or board");
	options->way = argv[optind++];
	if (strcmp(options->way, "two-point") && strcmp(options->way, "line") &&
	    strcmp(options->way, "board"))
		cli_usage("unknown method '%s'; expected two-point, line or board",
			  options->way);
	parse_files(options, argc, argv);
	options->source.rig = options->common.rig;
	options->source.guided = !options->source.n_paths && isatty(STDIN_FILENO);
	if (options->pixels &&
	    (options->common.from || strcmp(options->way, "two-point")))
		cli_usage("--pixels goes with two-point, and without --from");
}

/* --- lengths and board --------------------------------------------------------------- */

static void corner_pair(const char *option, const char *text, double to[2][2],
			double most)
{
	char *items[5];

	if (cli_list(option, (char *)text, items, 5) != 4)
		cli_usage("--%s: expected four numbers: X,Y,X,Y", option);
	for (int i = 0; i < 4; i++)
		to[i / 2][i % 2] = cli_number(option, items[i], 0, most);
}

static void need_schedule(const struct options *options)
{
	const struct depth_source *source = &options->source;

	if (!source->n_paths && !source->guided &&
	    (!source->pictures ||
	     (!strcmp(options->way, "board") && !(source->every_s > 0))))
		cli_usage("missing --from, or --images%s of the camera (needed without "
			  "a terminal)",
			  strcmp(options->way, "board") ? "" : " and --every");
}

static bool one_of(const struct options *options, bool (*is)(const char *))
{
	return options->source.n_paths == 1 && is(options->source.path[0]);
}

/* Print the reason and the first outliers. Nothing is changed. */
_Noreturn static void refuse(const struct incise_error *err,
			     const struct depth_lengths *l, const bool *inlier,
			     int inliers)
{
	char names[200] = "";
	size_t length = 0;

	for (int i = 0; inliers && i < l->n && length < sizeof(names) - 60; i++)
		if (!inlier[i])
			length += snprintf(names + length, sizeof(names) - length,
					   "%s%.40s", length ? ", " : " (", l->name[i]);
	cli_fail("%s%s%s", err->text, names, length ? ", …)" : "");
}

static void by_lengths(struct options *options, struct depth_result *result,
		       struct depth_lengths *l, struct incise_calibration_record *record)
{
	static struct incise_depth_fit fit;
	bool line = !strcmp(options->way, "line"), *inlier;
	struct incise_error err = {0};
	int rc;

	if (options->pixels) {
		char *items[FILES_MAX], name[30];
		int n = cli_list("pixels", (char *)options->pixels, items, FILES_MAX);

		for (int i = 0; i < n; i++) {
			snprintf(name, sizeof(name), "--pixels %d", i + 1);
			depth_lengths_add(l, cli_number("pixels", items[i], 1e-3, 1e5),
					  NAN, name);
		}
		l->vision_px = U_CLICKS_PX;
		snprintf(options->source.device, sizeof(options->source.device), "given");
	} else if (one_of(options, depth_is_csv)) {
		depth_lengths_read(l, options->source.path[0], line);
		l->vision_px = U_CLICKS_PX;
		snprintf(options->source.device, sizeof(options->source.device), "CSV");
	} else if (one_of(options, depth_is_recording)) {
		depth_lengths_recording(l, options->source.path[0], line);
		snprintf(options->source.device, sizeof(options->source.device),
			 "recording");
	} else if (line) {
		cli_usage("line: missing --from pairs.csv or --from NAME.rec");
	} else {
		need_schedule(options);
		depth_lengths_measure(l, &options->source);
	}
	inlier = cli_alloc(l->n, sizeof(*inlier));
	if (line) {
		struct incise_depth_lengths pairs = {
			l->mm, l->px, l->n, options->u_gauge / 100, options->u_zero_mm};

		rc = incise_calibrate_depth_line(&pairs, inlier, &fit, &err);
	} else {
		struct incise_depth_points points = {
			.length_mm = options->length_mm,
			.u_length_mm = options->u_length_mm,
			.length_px = l->px,
			.n = l->n,
			.u_px = options->u_px >= 0 ? options->u_px : l->vision_px,
		};

		rc = incise_calibrate_depth_points(&points, inlier, &fit, &err);
	}
	if (rc)
		refuse(&err, l, inlier, fit.inliers);
	result->fit = &fit;
	result->inlier = inlier;
	result->lengths = l;
	calibrate_value(record, "depth_mm_px", "mm/px", options->common.found.depth_mm_px,
			fit.mm_px, fit.u_mm_px);
	record->low = line ? (fit.full_px - fit.high_px) * fit.mm_px : NAN;
	record->high = line ? (fit.full_px - fit.low_px) * fit.mm_px : NAN;
	snprintf(record->method, sizeof(record->method),
		 line ? "straight line through %d of %d pairs, full_px %.3f"
		      : "%d of %d lengths of one known length, full_px %.3f",
		 fit.inliers, fit.n, fit.full_px);
	if (line && fit.bend_mm > BEND_MM && fit.bend_mm > BEND_SD * fit.bend_sd_mm) {
		record->pass = false;
		snprintf(record->verdict, sizeof(record->verdict),
			 "the pairs lie on a curve: a parabola is %.3f mm off the line "
			 "at its ends; turn the camera square to the plane",
			 fit.bend_mm);
	}
}

static void by_board(struct options *options, struct depth_result *result,
		     struct depth_corners *c, struct incise_calibration_record *record)
{
	static struct incise_board_fit fit;
	static struct incise_board_views views;
	struct incise_error err = {0};

	c->columns = options->columns;
	c->rows = options->rows;
	if (one_of(options, depth_is_csv)) {
		depth_corners_read(c, options->source.path[0]);
		snprintf(options->source.device, sizeof(options->source.device), "CSV");
	} else if (one_of(options, depth_is_recording)) {
		cli_usage("board: a recording does not show a board; give images or a "
			  "CSV of corners with --from");
	} else {
		need_schedule(options);
		depth_corners_find(c, &options->source);
	}
	views = (struct incise_board_views){
		.columns = c->columns,
		.rows = c->rows,
		.square_mm = options->square_mm,
		.u_square_mm = options->u_square / 100 * options->square_mm,
		.corners = c->px,
		.n = c->n,
		.u_plane_mm = options->u_plane_mm,
		.axis_px = {{c->width / 2.0, c->height * 0.1},
			    {c->width / 2.0, c->height * 0.9}},
		.width = c->width,
		.height = c->height,
	};
	if (options->axis)
		corner_pair("handle", options->axis, views.axis_px, 8192);
	for (int k = 0; k < 2; k++) {
		double low = fmin(views.axis_px[0][k], views.axis_px[1][k]);
		double high = fmax(views.axis_px[0][k], views.axis_px[1][k]);

		views.region_px[0][k] = k ? low : low - 100;
		views.region_px[1][k] = k ? high : high + 100;
	}
	if (options->region)
		corner_pair("region", options->region, views.region_px, 8192);
	if (incise_calibrate_depth_board(&views, &fit, &err))
		cli_fail_with(&err);
	result->board = &fit;
	result->views = &views;
	result->corners = c;
	calibrate_value(record, "depth_mm_px", "mm/px", options->common.found.depth_mm_px,
			fit.mm_px, fit.u_mm_px);
	snprintf(
		record->method, sizeof(record->method),
		"chessboard of %d x %d corners, %d of %d views, tilt at most %.2f degrees",
		c->columns, c->rows, fit.views, fit.n, fit.tilt_deg + 2 * fit.u_tilt_deg);
	if (fit.bend_mm > BEND_MM) {
		record->pass = false;
		snprintf(record->verdict, sizeof(record->verdict),
			 "one scale for the whole handle is up to %.3f mm wrong; turn "
			 "the camera square to the plane (it is %.1f degrees off)",
			 fit.bend_mm, fit.tilt_deg);
	}
}

/* --- record -------------------------------------------------------------------------- */

/* Reasons in this order: data that do not fit the method come first. */
static void judge(const struct options *options, struct incise_calibration_record *record)
{
	double scale = record->values[0].left, u = record->values[0].u / scale;
	double off = scale / options->nominal_mm_px - 1;

	if (!record->pass)
		return;
	record->pass = false;
	if (fabs(off) > options->tolerance) {
		snprintf(record->verdict, sizeof(record->verdict),
			 "%+.2f %% from the nominal %g mm/px, more than %g %%; check "
			 "length and pixels, or give the scale of your camera with "
			 "--nominal",
			 100 * off, options->nominal_mm_px, 100 * options->tolerance);
	} else if (2 * u > U_WORST) {
		snprintf(record->verdict, sizeof(record->verdict),
			 "U is %.2f %% of the scale, more than %.1f %%; give more "
			 "readings, or better ones",
			 200 * u, 100 * U_WORST);
	} else {
		record->pass = true;
		snprintf(record->verdict, sizeof(record->verdict),
			 "%+.2f %% from the nominal %g mm/px, within %g %%; U is %.3f %% "
			 "of the scale, within %.1f %%",
			 100 * off, options->nominal_mm_px, 100 * options->tolerance,
			 200 * u, 100 * U_WORST);
	}
}

static void end_record(const struct options *options, struct depth_result *result,
		       struct incise_calibration_record *record)
{
	struct incise_error err = {0};
	const char *raw = options->common.keep;

	judge(options, record);
	snprintf(record->device, sizeof(record->device), "%s", options->source.device);
	if (!raw && options->source.n_paths == 1 && depth_is_csv(options->common.from) &&
	    strcmp(options->common.from, "-"))
		raw = options->common.from;
	if (raw && incise_calibration_raw(record, raw, &err))
		cli_fail_with(&err);
	result->in_force = record->pass && !options->common.dry_run;
	/* Everything that can fail comes before the calibration changes. */
	if (options->common.report)
		depth_report_folder(result, options->common.report);
	calibrate_append(&options->common, record);
}

int main(int argc, char **argv)
{
	struct options options;
	struct incise_calibration_record record = {.kind = "depth",
						   .low = NAN,
						   .high = NAN,
						   .range_unit = "mm",
						   .pass = true};
	struct depth_lengths l = {0};
	struct depth_corners corners = {0};
	struct depth_result result = {
		.record = &record, .source = &options.source, .common = &options.common};

	parse(&options, argc, argv);
	result.way = options.way;
	cli_catch_signals();
	calibrate_find(&options.common);
	if (strcmp(options.way, "board"))
		by_lengths(&options, &result, &l, &record);
	else
		by_board(&options, &result, &corners, &record);
	if (options.common.keep && result.board)
		depth_corners_write(&corners, options.common.keep);
	else if (options.common.keep)
		depth_lengths_write(&l, options.common.keep,
				    !strcmp(options.way, "line"));
	end_record(&options, &result, &record);
	if (options.common.json) {
		json_print(depth_report_json(&result));
	} else {
		depth_report_text(&result, stdout);
		calibrate_result(&options.common, &record);
	}
	calibrate_require_pass(&record);
	return 0;
}
