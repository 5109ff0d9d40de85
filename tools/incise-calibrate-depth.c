// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: scale of the camera's picture in the plane of the scalpel, from
 * two points, a line of pairs, or a board.
 */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_depth.h>
#include <incise/calibration.h>
#include "cli.h"
#include "depth_data.h"
#include "depth_report.h"
#include "json.h"

#define LENGTH_MM 47.5	  /* paper 1, §2 */
#define U_LENGTH_MM 0.012 /* a caliper that is right to 0.02 mm: that over √3 */
#define U_CLICKS_PX 0.7	  /* two ends, half a pixel each */
#define U_GAUGE 0.05	  /* % */
#define U_ZERO_MM 0.02
#define U_SQUARE 0.02 /* % */
#define U_PLANE_MM 0.1
#define U_WORST 0.005 /* 2 u of more than that, relative, is no calibration */
#define BEND_MM 0.2   /* that one number is off, within a handle's length */
#define BEND_SD 4.0
#define FILES_MAX 1000

enum {
	OPT_FROM = CLI_LONG,
	OPT_KEEP,
	OPT_REPORT,
	OPT_DRY_RUN,
	OPT_JSON,
	OPT_LENGTH,
	OPT_LENGTH_U,
	OPT_PIXELS,
	OPT_PIXELS_U,
	OPT_PICTURES,
	OPT_EVERY,
	OPT_PICK,
	OPT_GAUGE_U,
	OPT_ZERO_U,
	OPT_BOARD,
	OPT_SQUARE,
	OPT_SQUARE_U,
	OPT_PLANE_U,
	OPT_AXIS,
	OPT_REGION,
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG", "rig.conf, or sim:KEY=VALUE,… (default: ./rig.conf)"},
	{'c', "calibration", "FILE",
	 "read as found, and written (default: calibration.conf)"},
	{OPT_FROM, "from", "FILE",
	 "pictures (more may follow), FILE.csv or NAME.rec instead of the\nrig's camera"},
	{OPT_KEEP, "keep", "FILE", "write the raw data there, as --from reads them"},
	{OPT_REPORT, "report", "DIR",
	 "report.txt, report.json, fit.png and residuals.png there"},
	{OPT_DRY_RUN, "dry-run", NULL, "change no calibration.conf"},
	{OPT_JSON, "json", NULL, "report as one JSON object"},
	{OPT_LENGTH, "length", "LENGTH", "two-point: known length (default: 47.5mm)"},
	{OPT_LENGTH_U, "length-u", "LENGTH",
	 "two-point: its standard uncertainty (default: 0.012mm)"},
	{OPT_PIXELS, "pixels", "PX,…", "two-point: the length in pixels, once or more"},
	{OPT_PIXELS_U, "pixels-u", "PX",
	 "two-point: standard uncertainty that all have alike\n(default: 0.7 of --pixels, 0.03 by vision)"},
	{OPT_PICTURES, "pictures", "N",
	 "take so many of the camera (default: on a terminal 50, of a\nboard 8)"},
	{OPT_EVERY, "every", "TIME",
	 "board: time between two pictures, without a terminal"},
	{OPT_PICK, "pick", "X,Y", "learn the handle's colour from this pixel"},
	{OPT_GAUGE_U, "gauge-u", "PERCENT",
	 "line: standard uncertainty of the gauge's scale (default: 0.05)"},
	{OPT_ZERO_U, "zero-u", "LENGTH",
	 "line: standard uncertainty of its zero (default: 0.02mm)"},
	{OPT_BOARD, "board", "COLSxROWS", "board: inner corners (default: 9x6)"},
	{OPT_SQUARE, "square", "LENGTH", "board: side of a square (default: 5mm)"},
	{OPT_SQUARE_U, "square-u", "PERCENT",
	 "board: standard uncertainty of the squares (default: 0.02)"},
	{OPT_PLANE_U, "plane-u", "LENGTH",
	 "board: how well it lies in the plane (default: 0.1mm)"},
	{OPT_AXIS, "axis", "X,Y,X,Y",
	 "board: ends of the handle in the picture (default: upright in\nits middle)"},
	{OPT_REGION, "region", "X,Y,X,Y",
	 "board: corners of the region of interest (default: 100 px\naround the axis)"},
	{0},
};

static const struct cli_verb verb = {
	.name = "calibrate depth",
	.synopsis = "two-point | line | board [OPTIONS]",
	.summary =
		"Measure the scale of the camera's picture in the plane of the scalpel, and write\n"
		"it to calibration.conf.\n"
		"two-point: a known length, seen as so many pixels.\n"
		"line: many pairs of a depth, by a gauge or the tracker, and an exposed length.\n"
		"board: a chessboard in the cutting plane, and tilted.",
	.options = options,
	.notes =
		"Example: incise calibrate depth two-point --length 47.5mm --pixels 400\n"
		"         incise calibrate depth board --from plane.png tilt*.png --square 5mm\n"
		"Exit codes: 0 done and in force, 1 failed or refused, 2 bad usage.",
};

static const struct cli_unit lengths[] = {
	{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1e3}, {0}};

struct wish {
	const char *way, *rig, *calibration, *from, *keep, *report;
	bool dry_run, json;
	double length_mm, u_length_mm, u_px, u_gauge, u_zero_mm;
	char *pixels, *axis, *region;
	int columns, rows;
	double square_mm, u_square, u_plane_mm;
	struct depth_source source;
};

static void board_size(struct wish *wish, const char *text)
{
	char rest;

	if (sscanf(text, "%dx%d%c", &wish->columns, &wish->rows, &rest) != 2 ||
	    wish->columns < 3 || wish->rows < 3 || wish->columns > 100 ||
	    wish->rows > 100 || wish->columns * wish->rows > INCISE_BOARD_CORNERS)
		cli_usage("--board: '%s': inner corners as 9x6, 3 or more, at most %d",
			  text, INCISE_BOARD_CORNERS);
}

static void take_option(struct wish *wish, int id)
{
	switch (id) {
	case 'r':
		wish->rig = optarg;
		break;
	case 'c':
		wish->calibration = optarg;
		break;
	case OPT_FROM:
		wish->from = optarg;
		break;
	case OPT_KEEP:
		wish->keep = optarg;
		break;
	case OPT_REPORT:
		wish->report = optarg;
		break;
	case OPT_DRY_RUN:
		wish->dry_run = true;
		break;
	case OPT_JSON:
		wish->json = true;
		break;
	case OPT_LENGTH:
		wish->length_mm = cli_quantity("--length", optarg, lengths, 0.1, 1000);
		break;
	case OPT_LENGTH_U:
		wish->u_length_mm = cli_quantity("--length-u", optarg, lengths, 0, 100);
		break;
	case OPT_PIXELS:
		wish->pixels = optarg;
		break;
	case OPT_PIXELS_U:
		wish->u_px = cli_number("pixels-u", optarg, 0, 1000);
		break;
	case OPT_PICTURES:
		wish->source.pictures =
			(int)cli_integer("pictures", optarg, 1, FILES_MAX);
		break;
	case OPT_EVERY:
		wish->source.every_s = cli_duration("every", optarg, 0.01, 3600);
		break;
	case OPT_PICK:
		wish->source.pick = optarg;
		break;
	case OPT_GAUGE_U:
		wish->u_gauge = cli_number("gauge-u", optarg, 0, 100);
		break;
	case OPT_ZERO_U:
		wish->u_zero_mm = cli_quantity("--zero-u", optarg, lengths, 0, 100);
		break;
	case OPT_BOARD:
		board_size(wish, optarg);
		break;
	case OPT_SQUARE:
		wish->square_mm = cli_quantity("--square", optarg, lengths, 0.01, 1000);
		break;
	case OPT_SQUARE_U:
		wish->u_square = cli_number("square-u", optarg, 0, 100);
		break;
	case OPT_PLANE_U:
		wish->u_plane_mm = cli_quantity("--plane-u", optarg, lengths, 0, 100);
		break;
	case OPT_AXIS:
		wish->axis = optarg;
		break;
	case OPT_REGION:
		wish->region = optarg;
		break;
	}
}

static void take_files(struct wish *wish, int argc, char **argv)
{
	struct depth_source *source = &wish->source;

	if (!wish->from && optind < argc)
		cli_usage("'%s': pictures follow --from", argv[optind]);
	if (!wish->from)
		return;
	source->path = calloc(argc - optind + 1, sizeof(*source->path));
	if (!source->path)
		cli_fail("no memory");
	source->path[source->n_paths++] = (char *)wish->from;
	while (optind < argc)
		source->path[source->n_paths++] = argv[optind++];
	if (source->n_paths > 1)
		for (int i = 0; i < source->n_paths; i++)
			if (depth_is_csv(source->path[i]) ||
			    depth_is_recording(source->path[i]))
				cli_usage("'%s': one CSV or recording at a time",
					  source->path[i]);
}

/* --- the three ways ------------------------------------------------------------------ */

static void corner_pair(const char *option, char *text, double to[2][2], double most)
{
	char *items[5];

	if (cli_list(option, text, items, 5) != 4)
		cli_usage("--%s: four numbers: X,Y,X,Y", option);
	for (int i = 0; i < 4; i++)
		to[i / 2][i % 2] = cli_number(option, items[i], 0, most);
}

static void need_schedule(const struct wish *wish)
{
	const struct depth_source *source = &wish->source;

	if (!source->n_paths && !source->guided &&
	    (!source->pictures ||
	     (!strcmp(wish->way, "board") && !(source->every_s > 0))))
		cli_usage("without a terminal give --from, or --pictures%s of the camera",
			  strcmp(wish->way, "board") ? "" : " and --every");
}

static bool one_of(const struct wish *wish, bool (*is)(const char *))
{
	return wish->source.n_paths == 1 && is(wish->source.path[0]);
}

/* What was refused is told with the first outliers, and nothing is changed. */
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

static void by_lengths(struct wish *wish, struct depth_result *result,
		       struct depth_lengths *l, struct incise_calibration_record *record)
{
	static struct incise_depth_fit fit;
	bool line = !strcmp(wish->way, "line"), *inlier;
	struct incise_error err = {0};
	int rc;

	if (wish->pixels) {
		char *items[FILES_MAX], name[30];
		int n = cli_list("pixels", wish->pixels, items, FILES_MAX);

		for (int i = 0; i < n; i++) {
			snprintf(name, sizeof(name), "--pixels %d", i + 1);
			depth_lengths_add(l, cli_number("pixels", items[i], 1e-3, 1e5),
					  NAN, name);
		}
		l->vision_px = U_CLICKS_PX;
		snprintf(wish->source.device, sizeof(wish->source.device), "given");
	} else if (one_of(wish, depth_is_csv)) {
		depth_lengths_read(l, wish->source.path[0], line);
		l->vision_px = U_CLICKS_PX;
		snprintf(wish->source.device, sizeof(wish->source.device), "CSV");
	} else if (one_of(wish, depth_is_recording)) {
		depth_lengths_recording(l, wish->source.path[0], line);
		snprintf(wish->source.device, sizeof(wish->source.device), "recording");
	} else if (line) {
		cli_usage("line: give --from pairs.csv or --from NAME.rec");
	} else {
		need_schedule(wish);
		depth_lengths_measure(l, &wish->source);
	}
	inlier = calloc(l->n, sizeof(*inlier));
	if (!inlier)
		cli_fail("no memory");
	if (line) {
		struct incise_depth_pairs pairs = {l->mm, l->px, l->n,
						   wish->u_gauge / 100, wish->u_zero_mm};

		rc = incise_calibrate_depth_line(&pairs, inlier, &fit, &err);
	} else {
		struct incise_depth_points points = {
			.length_mm = wish->length_mm,
			.u_length_mm = wish->u_length_mm,
			.length_px = l->px,
			.n = l->n,
			.u_px = wish->u_px >= 0 ? wish->u_px : l->vision_px,
		};

		rc = incise_calibrate_depth_points(&points, inlier, &fit, &err);
	}
	if (rc)
		refuse(&err, l, inlier, fit.inliers);
	result->fit = &fit;
	result->inlier = inlier;
	result->lengths = l;
	record->values[0].left = fit.mm_px;
	record->values[0].u = fit.u_mm_px;
	record->low = line ? (fit.full_px - fit.high_px) * fit.mm_px : NAN;
	record->high = line ? (fit.full_px - fit.low_px) * fit.mm_px : NAN;
	snprintf(record->method, sizeof(record->method),
		 line ? "straight line through %d of %d pairs, full_px %.3f"
		      : "%d of %d lengths of one known length, full_px %.3f",
		 fit.inliers, fit.n, fit.full_px);
	if (line && fit.bend_mm > BEND_MM && fit.bend_mm > BEND_SD * fit.bend_sd_mm) {
		record->pass = false;
		snprintf(
			record->verdict, sizeof(record->verdict),
			"the pairs lie on a curve: a parabola is %.3f mm off the line at "
			"its ends; is the camera square to the plane?",
			fit.bend_mm);
	}
}

static void by_board(struct wish *wish, struct depth_result *result,
		     struct depth_corners *c, struct incise_calibration_record *record)
{
	static struct incise_board_fit fit;
	static struct incise_board_views views;
	struct incise_error err = {0};

	c->columns = wish->columns;
	c->rows = wish->rows;
	if (one_of(wish, depth_is_csv)) {
		depth_corners_read(c, wish->source.path[0]);
		snprintf(wish->source.device, sizeof(wish->source.device), "CSV");
	} else if (one_of(wish, depth_is_recording)) {
		cli_usage("board: give pictures or a CSV of corners, not a recording");
	} else {
		need_schedule(wish);
		depth_corners_find(c, &wish->source);
	}
	views = (struct incise_board_views){
		.columns = c->columns,
		.rows = c->rows,
		.square_mm = wish->square_mm,
		.u_square_mm = wish->u_square / 100 * wish->square_mm,
		.corners = c->px,
		.n = c->n,
		.u_plane_mm = wish->u_plane_mm,
		.axis_px = {{c->width / 2.0, c->height * 0.1},
			    {c->width / 2.0, c->height * 0.9}},
		.width = c->width,
		.height = c->height,
	};
	if (wish->axis)
		corner_pair("axis", wish->axis, views.axis_px, 8192);
	for (int k = 0; k < 2; k++) {
		double low = fmin(views.axis_px[0][k], views.axis_px[1][k]);
		double high = fmax(views.axis_px[0][k], views.axis_px[1][k]);

		views.region_px[0][k] = k ? low : low - 100;
		views.region_px[1][k] = k ? high : high + 100;
	}
	if (wish->region)
		corner_pair("region", wish->region, views.region_px, 8192);
	if (incise_calibrate_depth_board(&views, &fit, &err))
		cli_fail_with(&err);
	result->board = &fit;
	result->views = &views;
	result->corners = c;
	record->values[0].left = fit.mm_px;
	record->values[0].u = fit.u_mm_px;
	snprintf(
		record->method, sizeof(record->method),
		"chessboard of %d x %d corners, %d of %d views, tilt at most %.2f degrees",
		c->columns, c->rows, fit.views, fit.n, fit.tilt_deg + 2 * fit.u_tilt_deg);
	if (fit.bend_mm > BEND_MM) {
		record->pass = false;
		snprintf(
			record->verdict, sizeof(record->verdict),
			"one number is up to %.3f mm off along the handle: turn the camera "
			"square to the plane (it is %.1f degrees off)",
			fit.bend_mm, fit.tilt_deg);
	}
}

/* --- record -------------------------------------------------------------------------- */

static void begin_record(const struct wish *wish,
			 struct incise_calibration_record *record)
{
	struct incise_calibration found;
	struct incise_error err = {0};

	*record = (struct incise_calibration_record){
		.kind = "depth",
		.n = 1,
		.low = NAN,
		.high = NAN,
		.range_unit = "mm",
		.pass = true,
	};
	snprintf(record->values[0].key, sizeof(record->values[0].key), "depth_mm_px");
	snprintf(record->values[0].unit, sizeof(record->values[0].unit), "mm/px");
	incise_calibration_nominal(&found);
	if (!access(wish->calibration, F_OK) &&
	    incise_calibration_load(wish->calibration, &found, &err))
		cli_fail_with(&err);
	record->values[0].found = found.depth_mm_px;
}

static void end_record(const struct wish *wish, struct depth_result *result,
		       struct incise_calibration_record *record)
{
	struct incise_error err = {0};
	double u = record->values[0].u / record->values[0].left;
	const char *raw = wish->keep;

	if (record->pass && 2 * u > U_WORST) {
		record->pass = false;
		snprintf(
			record->verdict, sizeof(record->verdict),
			"U is %.2f %% of the scale, more than %.1f %%: give more, or better, "
			"readings",
			200 * u, 100 * U_WORST);
	}
	if (record->pass)
		snprintf(record->verdict, sizeof(record->verdict),
			 "U is %.3f %% of the scale", 200 * u);
	snprintf(record->device, sizeof(record->device), "%s", wish->source.device);
	if (!raw && wish->source.n_paths == 1 && depth_is_csv(wish->from) &&
	    strcmp(wish->from, "-"))
		raw = wish->from;
	if (raw && incise_calibration_raw(record, raw, &err))
		cli_fail_with(&err);
	result->in_force = record->pass && !wish->dry_run;
	/* Whatever can fail comes before what changes the calibration. */
	if (wish->report)
		depth_report_folder(result, wish->report);
	if (cli_stop)
		cli_fail("stopped; the old calibration stays");
	if (!wish->dry_run && incise_calibration_append(wish->calibration, record, &err))
		cli_fail_with(&err);
}

int main(int argc, char **argv)
{
	struct wish wish = {
		.calibration = "calibration.conf",
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
	struct incise_calibration_record record;
	struct depth_lengths l = {0};
	struct depth_corners corners = {0};
	struct depth_result result = {.record = &record, .source = &wish.source};
	int id;

	while ((id = cli_next(&verb, argc, argv)) != CLI_END)
		take_option(&wish, id);
	if (optind == argc)
		cli_usage("how? two-point, line or board");
	wish.way = result.way = argv[optind++];
	if (strcmp(wish.way, "two-point") && strcmp(wish.way, "line") &&
	    strcmp(wish.way, "board"))
		cli_usage("'%s': two-point, line or board", wish.way);
	take_files(&wish, argc, argv);
	wish.source.rig = wish.rig;
	wish.source.guided = !wish.source.n_paths && isatty(STDIN_FILENO);
	if (wish.pixels && (wish.from || strcmp(wish.way, "two-point")))
		cli_usage("--pixels is of two-point, and without --from");
	cli_catch_signals();
	begin_record(&wish, &record);
	if (strcmp(wish.way, "board"))
		by_lengths(&wish, &result, &l, &record);
	else
		by_board(&wish, &result, &corners, &record);
	if (wish.keep && result.board)
		depth_corners_write(&corners, wish.keep);
	else if (wish.keep)
		depth_lengths_write(&l, wish.keep, !strcmp(wish.way, "line"));
	end_record(&wish, &result, &record);
	if (wish.json)
		json_print(depth_report_json(&result));
	else
		depth_report_text(&result, stdout);
	cli_finish();
	if (!record.pass)
		cli_fail("not in force: %s", record.verdict);
	return 0;
}
