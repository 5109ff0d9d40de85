// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate frame: where a haptic device is in the scene, from points of the scene that
 * its handle touches.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_frame.h>
#include "../cli/handle.h"
#include "../cli/json.h"
#include "calibrate.h"
#include "table.h"

#define N INCISE_FRAME_POINTS_MAX

struct frame {
	struct calibrate common;
	struct incise_frame_point point[N];
	int n;
	struct incise_frame_fit fit;
};

static struct incise_frame_point *next_point(struct frame *frame)
{
	if (frame->n == N)
		cli_fail("more than %d points; choose 3 to %d that are far apart", N, N);
	return &frame->point[frame->n++];
}

static void parse_point(void *run, char *text)
{
	struct incise_frame_point *point = next_point(run);
	char *items[4];

	if (cli_list("point", text, items, 4) != 3)
		cli_usage("--point: expected X,Y,Z in mm; give three numbers");
	for (int k = 0; k < 3; k++)
		point->scene_mm[k] = cli_number("point", items[k], -1e6, 1e6);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct frame),
	{0, "point", "X,Y,Z",
	 "a point of the scene in mm; give three to six, in the order in which they "
	 "are touched",
	 CLI_PARSED_BY(parse_point)},
	{0, "from", "FILE.csv", "take points that were touched, instead of a rig",
	 CLI_INPUT(struct frame, common.from)},
	{'o', "output", "FILE.csv", "write the points as CSV, for --from",
	 CLI_OUTPUT(struct frame, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct frame),
	{0},
};

static const struct cli_command command = {
	.name = "calibrate frame",
	.synopsis = "[--rig RIG --point X,Y,Z … | --from FILE.csv] [OPTIONS]",
	.summary =
		"Measure where a haptic device is in the scene: touch three to six points of "
		"the scene with the handle, one after the other, and at each press Enter or a "
		"button of the handle. A point out of the plane of the others shows a "
		"mirrored axis.",
	.options = option_table,
	.examples = "incise calibrate frame --rig haply: --point 0,0,0 --point 60,0,0 "
		    "--point 0,60,0 --point 20,20,40",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

/* --- points ------------------------------------------------------------------------------ */

/* In the order of the struct. */
static const struct table_form form = {
	"points",
	"x_mm, y_mm, z_mm, device_x_mm, device_y_mm, device_z_mm",
	"sd_mm is",
	{{"x_mm"},
	 {"y_mm"},
	 {"z_mm"},
	 {"device_x_mm"},
	 {"device_y_mm"},
	 {"device_z_mm"},
	 {"sd_mm"}},
	.n_needed = 6,
};

#define COLUMNS ((int)(sizeof(struct incise_frame_point) / sizeof(double)))

static void add_point(void *run, const struct table *table, const double *row)
{
	struct incise_frame_point *point = next_point(run);

	(void)table;
	memcpy(point, row, sizeof(*point));
	if (isnan(point->sd_mm))
		point->sd_mm = 0;
}

static void read_points(void *run, const char *path)
{
	table_read(path, &form, add_point, run);
}

static void write_points(const void *run, FILE *out)
{
	const struct frame *frame = run;

	for (int k = 0; k < COLUMNS; k++)
		fprintf(out, "%s%s", k ? "," : "", form.columns[k].name);
	for (int i = 0; i < frame->n * COLUMNS; i++)
		fprintf(out, "%c%.17g", i % COLUMNS ? ',' : '\n',
			((const double *)frame->point)[i]);
	fputc('\n', out);
}

static void check_frame_options(void *run, int argc, char **argv)
{
	struct frame *frame = run;

	cli_no_operands(argc, argv, "--from");
	if (frame->common.from && frame->n)
		cli_usage("--from does not go with --point: the file has its own");
	calibrate_check_source(&frame->common, !frame->common.from, "the file");
	if (!frame->common.from && frame->n < INCISE_FRAME_POINTS_MIN)
		cli_usage(
			"%s of the scene: expected 3 to %d; give --point X,Y,Z for each",
			cli_count(frame->n, "point"), N);
	cli_catch_signals();
}

/* --- live -------------------------------------------------------------------------------- */

#define HOLD_S 0.3   /* of a point */
#define MOVED_MM 1.0 /* largest standard deviation of a handle that is held still */

static void touch_points(void *run)
{
	struct frame *frame = run;
	struct incise_rig *rig = cli_open_rig(frame->common.rig, INCISE_RIG_HAPTIC);
	struct incise_error err = {0};
	struct handle handle;

	if (!incise_rig_haptic(rig))
		cli_fail("the rig has no haptic device; name one, such as --rig haply:");
	handle_begin(&handle, rig);
	calibrate_words(frame->common.record.device, "%s", handle.info.name);
	for (int i = 0; i < frame->n;) {
		struct incise_frame_point *point = &frame->point[i];
		const double *at = point->scene_mm;

		fprintf(stderr,
			"point %d of %d: touch (%g, %g, %g) mm, keep still, and press "
			"Enter or a button\n",
			i + 1, frame->n, at[0], at[1], at[2]);
		if (handle_await_press(&handle, &err) ||
		    handle_record(&handle, HOLD_S, &err) || handle_check(&handle, &err))
			cli_fail_with(&err);
		point->sd_mm = handle_mean(&handle, point->device_mm);
		if (point->sd_mm <= MOVED_MM)
			i++;
		else
			cli_warn("the handle moved by %.2g mm; touch the point again",
				 point->sd_mm);
	}
	free(handle.samples);
	incise_rig_close(rig);
}

/* --- the fit ----------------------------------------------------------------------------- */

static int fit_frame(void *run, struct incise_error *err)
{
	static const char *const keys[] = {"frame_turn_x_deg", "frame_turn_y_deg",
					   "frame_turn_z_deg", "frame_x_mm",
					   "frame_y_mm",       "frame_z_mm"};
	struct frame *frame = run;
	struct incise_calibration_record *record = &frame->common.record;
	const struct incise_frame_fit *fit = &frame->fit;
	int rc = incise_calibrate_frame(frame->point, frame->n, &frame->fit, err);

	if (rc)
		return rc;
	for (int i = 0; i < 6; i++)
		calibrate_value(&frame->common, keys[i], i < 3 ? "degrees" : "mm",
				i < 3 ? fit->turn_deg[i] : fit->origin_mm[i - 3],
				sqrt(fit->covariance[7 * i]));
	calibrate_covariance(record, fit->covariance, 6);
	calibrate_words(record->method, "least squares of %d touched points", frame->n);
	calibrate_words(record->verdict,
			"residuals %.3f mm rms with %d degrees of freedom, within %g mm; "
			"distances %.4f of the scene's",
			fit->rms_mm, fit->freedom, INCISE_FRAME_RMS_MM, fit->scale);
	if (fit->flat)
		cli_warn(
			"the points lie near a plane, where a mirrored axis does not show%s; "
			"touch one more, out of it",
			frame->n > 3 ? "" : ", and residuals of three say little");
	return 0;
}

/* --- the report -------------------------------------------------------------------------- */

static void print_frame_report(const void *run, FILE *out)
{
	const struct frame *frame = run;

	fputs("Frame of the haptic device in the scene\n\npoint  residual / mm  sd / mm\n",
	      out);
	for (int i = 0; i < frame->n; i++)
		fprintf(out, "%5d  %13.3f  %7.3f\n", i + 1, frame->fit.residual_mm[i],
			frame->point[i].sd_mm);
}

static json_t *make_frame_json(const void *run)
{
	const struct frame *frame = run;
	const struct incise_frame_fit *fit = &frame->fit;
	json_t *details = json_object();

	json_object_set_new(details, "residual_mm",
			    json_numbers(fit->residual_mm, frame->n));
	json_set_number(details, "rms_error_mm", fit->rms_mm);
	json_set_integer(details, "freedom", fit->freedom);
	json_set_number(details, "spread_mm", fit->spread_mm);
	json_set_number(details, "u_touch_mm", fit->u_touch_mm);
	json_set_number(details, "scale", fit->scale);
	json_object_set_new(details, "flat", json_boolean(fit->flat));
	return calibrate_json(&frame->common, details);
}

int calibrate_frame(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "frame",
		.command = &command,
		.check = check_frame_options,
		.read = read_points,
		.measure = touch_points,
		.write = write_points,
		.fit = fit_frame,
		.text = print_frame_report,
		.json = make_frame_json,
	};
	static struct frame frame;

	return calibrate_run(&kind, argc, argv, &frame);
}
