// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate depth: scale of the camera's picture in the plane of the scalpel, from
 * two points, a line of pairs, or a board.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_depth.h>
#include <incise/calibration.h>
#include "calibrate/calibrate_result.h"
#include "calibrate/depth_report.h"
#include "calibrate/depth_wish.h"
#include "cli/json.h"

#define U_CLICKS_PX 0.7 /* two ends, half a pixel each */
#define U_WORST 0.005	/* 2 u of more than that, relative, is no calibration */
#define BEND_MM 0.2	/* that one number is off, within a handle's length */
#define BEND_SD 4.0
/* --- the three ways ------------------------------------------------------------------ */

static void corner_pair(const char *option, char *text, double to[2][2], double most)
{
	char *items[5];

	if (cli_list(option, text, items, 5) != 4)
		cli_usage("--%s: four numbers: X,Y,X,Y", option);
	for (int i = 0; i < 4; i++)
		to[i / 2][i % 2] = cli_number(option, items[i], 0, most);
}

static void need_schedule(const struct depth_wish *wish)
{
	const struct depth_source *source = &wish->source;

	if (!source->n_paths && !source->guided &&
	    (!source->pictures ||
	     (!strcmp(wish->way, "board") && !(source->every_s > 0))))
		cli_usage("without a terminal give --from, or --pictures%s of the camera",
			  strcmp(wish->way, "board") ? "" : " and --every");
}

static bool one_of(const struct depth_wish *wish, bool (*is)(const char *))
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

static void by_lengths(struct depth_wish *wish, struct depth_result *result,
		       struct depth_lengths *l, struct incise_calibration_record *record)
{
	static struct incise_depth_fit fit;
	bool line = !strcmp(wish->way, "line"), *inlier;
	struct incise_error err = {0};
	int rc;

	if (wish->pixels) {
		char *items[DEPTH_FILES_MAX], name[30];
		int n = cli_list("pixels", wish->pixels, items, DEPTH_FILES_MAX);

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
		struct incise_depth_lengths pairs = {
			l->mm, l->px, l->n, wish->u_gauge / 100, wish->u_zero_mm};

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
	calibrate_value(record, "depth_mm_px", "mm/px", wish->common.found.depth_mm_px,
			fit.mm_px, fit.u_mm_px);
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

static void by_board(struct depth_wish *wish, struct depth_result *result,
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
	calibrate_value(record, "depth_mm_px", "mm/px", wish->common.found.depth_mm_px,
			fit.mm_px, fit.u_mm_px);
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

static void end_record(const struct depth_wish *wish, struct depth_result *result,
		       struct incise_calibration_record *record)
{
	struct incise_error err = {0};
	double u = record->values[0].u / record->values[0].left;
	const char *raw = wish->common.keep;

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
	if (!raw && wish->source.n_paths == 1 && depth_is_csv(wish->common.from) &&
	    strcmp(wish->common.from, "-"))
		raw = wish->common.from;
	if (raw && incise_calibration_raw(record, raw, &err))
		cli_fail_with(&err);
	result->in_force = record->pass && !wish->common.dry_run;
	/* Whatever can fail comes before what changes the calibration. */
	if (wish->common.report)
		depth_report_folder(result, wish->common.report);
	if (cli_stop)
		cli_fail("stopped; the old calibration stays");
	if (!wish->common.dry_run &&
	    incise_calibration_append(wish->common.calibration, record, &err))
		cli_fail_with(&err);
}

int main(int argc, char **argv)
{
	struct depth_wish wish;
	struct incise_calibration_record record = {.kind = "depth",
						   .low = NAN,
						   .high = NAN,
						   .range_unit = "mm",
						   .pass = true};
	struct depth_lengths l = {0};
	struct depth_corners corners = {0};
	struct depth_result result = {.record = &record, .source = &wish.source};

	depth_wish_take(&wish, argc, argv);
	result.way = wish.way;
	cli_catch_signals();
	calibrate_find(&wish.common);
	if (strcmp(wish.way, "board"))
		by_lengths(&wish, &result, &l, &record);
	else
		by_board(&wish, &result, &corners, &record);
	if (wish.common.keep && result.board)
		depth_corners_write(&corners, wish.common.keep);
	else if (wish.common.keep)
		depth_lengths_write(&l, wish.common.keep, !strcmp(wish.way, "line"));
	end_record(&wish, &result, &record);
	if (wish.common.json)
		json_print(depth_report_json(&result));
	else
		depth_report_text(&result, stdout);
	cli_finish();
	if (!record.pass)
		cli_fail("not in force: %s", record.verdict);
	return 0;
}
