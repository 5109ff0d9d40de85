// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What is asked of incise calibrate depth; see depth_wish.h.
 */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_depth.h>
#include "depth_wish.h"

#define LENGTH_MM 47.5	  /* paper 1, §2 */
#define U_LENGTH_MM 0.012 /* a caliper that is right to 0.02 mm: that over √3 */
#define U_GAUGE 0.05	  /* % */
#define U_ZERO_MM 0.02
#define U_SQUARE 0.02 /* % */
#define U_PLANE_MM 0.1

enum {
	OPT_LENGTH = CALIBRATE_OWN,
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
	{CALIBRATE_FROM, "from", "FILE",
	 "pictures (more may follow), FILE.csv or NAME.rec instead of the\nrig's camera"},
	{CALIBRATE_KEEP, "keep", "FILE",
	 "write the raw data there, as --from reads them"},
	{CALIBRATE_REPORT, "report", "DIR",
	 "report.txt, report.json, fit.png and residuals.png there"},
	{CALIBRATE_DRY_RUN, "dry-run", NULL, "change no calibration.conf"},
	{CALIBRATE_JSON, "json", NULL, "report as one JSON object"},
	{OPT_LENGTH, "length", "LENGTH", "two-point: known length (default: 47.5mm)"},
	{OPT_LENGTH_U, "length-u", "LENGTH",
	 "two-point: its standard uncertainty (default: 0.012mm)"},
	{OPT_PIXELS, "pixels", "PX,...", "two-point: the length in pixels, once or more"},
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

static const struct cli_command command = {
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

static void board_size(struct depth_wish *wish, const char *text)
{
	char rest;

	if (sscanf(text, "%dx%d%c", &wish->columns, &wish->rows, &rest) != 2 ||
	    wish->columns < 3 || wish->rows < 3 || wish->columns > 100 ||
	    wish->rows > 100 || wish->columns * wish->rows > INCISE_BOARD_CORNERS)
		cli_usage("--board: '%s': inner corners as 9x6, 3 or more, at most %d",
			  text, INCISE_BOARD_CORNERS);
}

static void take_option(struct depth_wish *wish, int id)
{
	switch (id) {
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
			(int)cli_integer("pictures", optarg, 1, DEPTH_FILES_MAX);
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
	default:
		calibrate_option(&wish->common, id);
	}
}

static void take_files(struct depth_wish *wish, int argc, char **argv)
{
	struct depth_source *source = &wish->source;

	if (!wish->common.from && optind < argc)
		cli_usage("'%s': pictures follow --from", argv[optind]);
	if (!wish->common.from)
		return;
	source->path = calloc(argc - optind + 1, sizeof(*source->path));
	if (!source->path)
		cli_fail("no memory");
	source->path[source->n_paths++] = (char *)wish->common.from;
	while (optind < argc)
		source->path[source->n_paths++] = argv[optind++];
	if (source->n_paths > 1)
		for (int i = 0; i < source->n_paths; i++)
			if (depth_is_csv(source->path[i]) ||
			    depth_is_recording(source->path[i]))
				cli_usage("'%s': one CSV or recording at a time",
					  source->path[i]);
}

void depth_wish_take(struct depth_wish *wish, int argc, char **argv)
{
	int id;

	*wish = (struct depth_wish){
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
	while ((id = cli_next(&command, argc, argv)) != CLI_END)
		take_option(wish, id);
	if (optind == argc)
		cli_usage("how? two-point, line or board");
	wish->way = argv[optind++];
	if (strcmp(wish->way, "two-point") && strcmp(wish->way, "line") &&
	    strcmp(wish->way, "board"))
		cli_usage("'%s': two-point, line or board", wish->way);
	take_files(wish, argc, argv);
	wish->source.rig = wish->common.rig;
	wish->source.guided = !wish->source.n_paths && isatty(STDIN_FILENO);
	if (wish->pixels && (wish->common.from || strcmp(wish->way, "two-point")))
		cli_usage("--pixels is of two-point, and without --from");
}
