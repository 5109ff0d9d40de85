// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: the scale of the camera's frame in the plane of the scalpel, from
 * two points, a line of pairs, or a board.
 */
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "calibrate/depth.h"

static const struct cli_unit lengths[] = {
	{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1e3}, {0}};

static void parse_tolerance(void *tolerance, char *text)
{
	*(double *)tolerance = cli_number("tolerance", text, 0.001, 1000) / 100;
}

static void parse_board(void *run, char *text)
{
	struct depth *depth = run;
	char rest;

	if (sscanf(text, "%dx%d%c", &depth->corners.columns, &depth->corners.rows,
		   &rest) != 2 ||
	    depth->corners.columns < 3 || depth->corners.rows < 3 ||
	    depth->corners.columns > 100 || depth->corners.rows > 100 ||
	    depth->corners.columns * depth->corners.rows > INCISE_BOARD_CORNERS)
		cli_usage(
			"--board: expected inner corners such as 9x6, 3 or more each way "
			"and at most %d together, found '%s'",
			INCISE_BOARD_CORNERS, text);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct depth),
	{0, "from", "FILE",
	 "images (more may follow), FILE.csv or NAME.rec instead of the rig's "
	 "camera",
	 CLI_INPUT(struct depth, common.from)},
	{0, "keep", "FILE", "write the raw data to this file, for --from",
	 CLI_OUTPUT(struct depth, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct depth),
	{0, "nominal", "MM_PX", "nominal scale to compare with (default: 0.11875)",
	 CLI_NUMBER(struct depth, nominal_mm_px, 1e-4, 10)},
	{0, "tolerance", "PERCENT", "largest deviation from it that passes (default: 5)",
	 CLI_PARSED(struct depth, tolerance, parse_tolerance)},
	{0, "length", "LENGTH", "two-point: known length (default: 47.5mm)",
	 CLI_QUANTITY(struct depth, length_mm, lengths, 0.1, 1000)},
	{0, "length-u", "LENGTH",
	 "two-point: its standard uncertainty (default: 0.012mm)",
	 CLI_QUANTITY(struct depth, u_length_mm, lengths, 0, 100)},
	{0, "pixels", "PX,...", "two-point: the length in pixels, one value or more",
	 CLI_TEXT(struct depth, pixels)},
	{0, "pixels-u", "PX",
	 "two-point: standard uncertainty common to all lengths (default: 0.7 for "
	 "--pixels, 0.03 from images)",
	 CLI_NUMBER(struct depth, u_px, 0, 1000)},
	{0, "images", "N",
	 "number of frames to take from the camera (default: 50 on a terminal, 8 "
	 "of a board)",
	 CLI_INTEGER(struct depth, pictures, 1, DEPTH_FILES_MAX)},
	{0, "every", "TIME", "board: time between two frames, without a terminal",
	 CLI_DURATION(struct depth, every_s, 0.01, 3600)},
	{0, "pick", "X,Y", "learn the colour of the handle from this pixel",
	 CLI_TEXT(struct depth, pick)},
	{0, "gauge-u", "PERCENT",
	 "line: standard uncertainty of the scale of the depth gauge (default: "
	 "0.05)",
	 CLI_NUMBER(struct depth, u_gauge, 0, 100)},
	{0, "zero-u", "LENGTH",
	 "line: standard uncertainty of its zero (default: 0.02mm)",
	 CLI_QUANTITY(struct depth, u_zero_mm, lengths, 0, 100)},
	{0, "board", "COLSxROWS", "board: inner corners (default: 9x6)",
	 CLI_PARSED_BY(parse_board)},
	{0, "square", "LENGTH", "board: side of a square (default: 5mm)",
	 CLI_QUANTITY(struct depth, square_mm, lengths, 0.01, 1000)},
	{0, "square-u", "PERCENT",
	 "board: standard uncertainty of the squares (default: 0.02)",
	 CLI_NUMBER(struct depth, u_square, 0, 100)},
	{0, "plane-u", "LENGTH",
	 "board: standard uncertainty of its distance from the cutting plane "
	 "(default: 0.1mm)",
	 CLI_QUANTITY(struct depth, u_plane_mm, lengths, 0, 100)},
	{0, "handle", "X,Y,X,Y",
	 "board: ends of the handle in the image (default: upright in its middle)",
	 CLI_TEXT(struct depth, axis)},
	{0, "region", "X,Y,X,Y",
	 "board: corners of the region of interest (default: 100 px around the "
	 "axis)",
	 CLI_TEXT(struct depth, region)},
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

static void parse_options(struct depth *depth, int argc, char **argv)
{
	struct incise_calibration nominal;
	const char *method;

	incise_calibration_nominal(&nominal);
	depth->nominal_mm_px = nominal.depth_mm_px;
	cli_parse(&command, argc, argv, depth);
	if (optind == argc)
		cli_usage("missing method: two-point, line or board");
	method = argv[optind++];
	while (depth_methods[depth->method] &&
	       strcmp(method, depth_methods[depth->method]))
		depth->method++;
	if (!depth_methods[depth->method])
		cli_usage("unknown method '%s'; expected two-point, line or board",
			  method);
	parse_files(depth, argc, argv);
	depth->guided = !depth->n_paths && isatty(STDIN_FILENO);
	if (depth->pixels && (depth->common.from || depth->method != DEPTH_TWO_POINT))
		cli_usage("--pixels goes with two-point, and without --from");
	cli_catch_signals();
}

int main(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "depth",
		.read = depth_read,
		.measure = depth_measure,
		.write = depth_write,
		.fit = depth_fit,
		.text = depth_text,
		.summary = depth_text,
		.json = depth_json,
		.draw = depth_draw,
	};
	static struct depth depth = {
		.tolerance =
			0.05, /* as for force: a larger deviation is more often an error */
		.length_mm = 47.5, /* paper 1, §2 */
		.u_length_mm =
			0.012, /* a caliper that is right to 0.02 mm: that over √3 */
		.u_px = -1,
		.u_gauge = 0.05, /* % */
		.u_zero_mm = 0.02,
		.corners = {.columns = 9, .rows = 6},
		.square_mm = 5,
		.u_square = 0.02, /* % */
		.u_plane_mm = 0.1,
	};

	parse_options(&depth, argc, argv);
	return calibrate_run(&kind, &depth);
}
