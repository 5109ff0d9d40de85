// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate tip: where the tip of the blade is in the tracker's sensor, from turning
 * the tool about its tip in a dimple.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/calibrate_tip.h>
#include <incise/rig.h>
#include "../../lib/base/vector.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/recording.h"
#include "calibrate.h"
#include "table.h"

#define POLL_NS 10000000LL
#define CHECK_NS 1000000000LL
#define READ 64

/* More would not improve it beyond the tracker's error. */
#define ENOUGH_U_MM 0.02
#define ENOUGH_CONE_DEG 70.0
#define ENOUGH_BLOCKS 300

struct tip {
	struct calibrate common;
	double time_s;	     /* 0: not given */
	double u_surface_mm; /* NAN: not given */
	struct incise_tip_pose *poses;
	int n;
	int doubtful; /* left out: the tracker marked them */
	struct incise_tip_fit fit;
	bool *inlier; /* n */
};

static void parse_u(void *run, char *text)
{
	static const struct cli_option keys[] = {
		{0, "given-u surface", "MM", NULL,
		 CLI_NUMBER(struct tip, u_surface_mm, 0, 1000)},
		{0},
	};

	cli_keys(text, keys, run);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct tip),
	{0, "duration", "TIME",
	 "longest recording (default: 20s); ends earlier when the tip is known "
	 "well enough",
	 CLI_DURATION(struct tip, time_s, 1, 600)},
	{0, "given-u", "surface=MM",
	 "standard uncertainty of the tissue surface of rig.conf along its normal, "
	 "which is not measured: for the uncertainty of depths",
	 CLI_PARSED_BY(parse_u)},
	{0, "from", "FILE",
	 "take the poses from a CSV file or a recording instead of a rig",
	 CLI_INPUT(struct tip, common.from)},
	{'o', "output", "FILE.csv", "write the poses as CSV, for --from",
	 CLI_OUTPUT(struct tip, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct tip),
	{0},
};

static const struct cli_command command = {
	.name = "calibrate tip",
	.synopsis = "[--rig RIG | --from FILE] [OPTIONS]",
	.summary =
		"Measure the position of the blade's tip in the frame of the tracker's "
		"sensor (pivot calibration). Put the tip into a dimple that does not "
		"move, and rotate the tool about it in all directions, by at least 60 "
		"degrees from side to side.",
	.options = option_table,
	.examples = "incise calibrate tip --rig rig.conf --duration 20s -o tip",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

static void check_tip_options(void *run, int argc, char **argv)
{
	struct tip *tip = run;

	cli_no_operands(argc, argv, "--from");
	calibrate_check_source(&tip->common, tip->time_s, "the file");
	cli_catch_signals();
}

/* --- poses -------------------------------------------------------------------------- */

#define POSES_MAX (1 << 20)

static struct incise_tip_pose *next_pose(struct tip *tip)
{
	if (tip->n == POSES_MAX)
		cli_fail("too many poses; a minute of them is enough");
	tip->poses = cli_grow(tip->poses, (size_t)tip->n, sizeof(*tip->poses));
	return &tip->poses[tip->n++];
}

static void add_pose(struct tip *tip, const struct incise_tracker_sample *sample)
{
	struct incise_tip_pose *pose;

	if (!incise_pose_usable(sample->status)) {
		tip->doubtful++;
		return;
	}
	pose = next_pose(tip);
	pose->t_ns = sample->t_ns;
	memcpy(pose->position_mm, sample->position_mm, sizeof(pose->position_mm));
	memcpy(pose->quaternion, sample->quaternion, sizeof(pose->quaternion));
}

static void read_recording(struct tip *tip, const char *path)
{
	struct incise_error err = {0};
	struct incise_recording *recording = recording_open(path);
	struct incise_tracker_sample *samples;
	int n = incise_recording_poses(recording, &samples, &err);

	if (n < 0)
		cli_fail_with(&err);
	for (int i = 0; i < n; i++)
		add_pose(tip, &samples[i]);
	free(samples);
	incise_recording_close(recording);
}

static const struct table_form form = {
	"poses",
	"x_mm, y_mm, z_mm, qw, qx, qy, qz",
	"t_s is",
	{{"x_mm"}, {"y_mm"}, {"z_mm"}, {"qw"}, {"qx"}, {"qy"}, {"qz"}, {"t_s"}},
	.n_needed = 7,
};

static void add_tip_row(void *run, const struct table *table, const double *row)
{
	struct tip *tip = run;
	double t_s = isnan(row[7]) ? tip->n : row[7];
	struct incise_tip_pose *pose = next_pose(tip);

	if (fabs(t_s) > 1e9)
		cli_fail("%s:%d: t_s: expected a number up to 1e9; correct it",
			 table->path, table->line);
	pose->t_ns = llround(t_s * 1e9);
	memcpy(pose->position_mm, row, sizeof(pose->position_mm));
	memcpy(pose->quaternion, row + 3, sizeof(pose->quaternion));
}

static void read_poses(void *run, const char *path)
{
	struct stat st;

	if (stat(path, &st) && errno != ENOENT)
		cli_fail("%s: %s", path, strerror(errno));
	/* or a recording of which only NAME.rec.part exists */
	if (S_ISDIR(st.st_mode) || cli_ends_with(path, ".rec"))
		read_recording(run, path);
	else
		table_read(path, &form, add_tip_row, run);
}

static void write_poses(const void *run, FILE *out)
{
	const struct tip *tip = run;

	fprintf(out, "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n");
	for (int i = 0; i < tip->n; i++) {
		const struct incise_tip_pose *pose = &tip->poses[i];

		fprintf(out, "%.9f", (pose->t_ns - tip->poses[0].t_ns) * 1e-9);
		for (int k = 0; k < 3; k++)
			fprintf(out, ",%.17g", pose->position_mm[k]);
		for (int k = 0; k < 4; k++)
			fprintf(out, ",%.17g", pose->quaternion[k]);
		putc('\n', out);
	}
}

/* --- live ---------------------------------------------------------------------------- */

static double largest_u(const struct incise_tip_fit *fit)
{
	return sqrt(
		fmax(fit->covariance[0], fmax(fit->covariance[4], fit->covariance[8])));
}

/* Print the progress. Returns whether the tip is known well enough. */
static bool check_progress(const struct tip *tip)
{
	struct incise_tip_fit fit;
	struct incise_error err = {0};
	int rc = incise_calibrate_tip(tip->poses, tip->n, NULL, &fit, &err);

	cli_progress("%d poses, cone %.0f of %g degrees, rms %.3f mm, U %.3f mm%s%s",
		     fit.n, fit.cone_deg, INCISE_TIP_CONE_DEG, fit.rms_mm,
		     2 * largest_u(&fit), rc ? ": " : "", rc ? err.text : "");
	return !rc && fit.cone_deg >= ENOUGH_CONE_DEG && fit.blocks >= ENOUGH_BLOCKS &&
	       2 * largest_u(&fit) < ENOUGH_U_MM;
}

static void record_poses(void *run)
{
	struct tip *tip = run;
	struct incise_tracker_info info;
	struct incise_rig *rig = cli_open_rig(tip->common.rig, INCISE_RIG_TRACKER);
	double time_s = tip->time_s > 0 ? tip->time_s : 20;
	struct incise_tracker_sample samples[READ];
	struct incise_clock *clock;
	int64_t now, end, next_check;
	bool enough = false;
	int station = 0;

	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Put the tip into its dimple and press Enter; then rotate the "
			"tool in all directions. ");
		calibrate_await_enter();
	}
	incise_tracker_info(incise_rig_tracker(rig), &info);
	station = info.scalpel_station;
	calibrate_words(tip->common.record.device, "%s", info.name);
	clock = incise_rig_clock(rig);
	now = incise_clock_now(clock);
	end = now + llround(time_s * INCISE_NS_PER_S);
	next_check = now + CHECK_NS;
	/* drop the poses before Enter */
	while (incise_tracker_read(incise_rig_tracker(rig), samples, READ) == READ)
		;
	while (now < end && !enough && !cli_stop) {
		int n;

		incise_clock_wait_until(clock, now + POLL_NS);
		now = incise_clock_now(clock);
		n = incise_tracker_read(incise_rig_tracker(rig), samples, READ);
		if (n < 0) {
			char text[200];

			incise_tracker_cause(incise_rig_tracker(rig), text, sizeof(text));
			cli_fail("the tracker: %s", *text ? text : strerror(-n));
		}
		for (int i = 0; i < n; i++) {
			station = station ? station : samples[i].station;
			if (samples[i].station == station)
				add_pose(tip, &samples[i]);
		}
		if (now >= next_check) {
			enough = check_progress(tip);
			next_check += CHECK_NS;
		}
	}
	cli_progress_end();
	incise_rig_close(rig);
	calibrate_check_stop();
}

/* --- the fit ------------------------------------------------------------------------- */

static int fit_tip(void *run, struct incise_error *err)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};
	struct tip *tip = run;
	struct incise_calibration_record *record = &tip->common.record;
	const struct incise_tip_fit *fit = &tip->fit;
	int rc;

	tip->inlier = cli_alloc((size_t)tip->n, sizeof(*tip->inlier));
	rc = incise_calibrate_tip(tip->poses, tip->n, tip->inlier, &tip->fit, err);
	if (rc)
		return rc;
	if (tip->doubtful)
		cli_warn("left out %s that the tracker marks as doubtful",
			 cli_count(tip->doubtful, "sample"));
	for (int i = 0; i < 3; i++)
		calibrate_value(&tip->common, keys[i], "mm", fit->tip_mm[i],
				sqrt(fit->covariance[4 * i]));
	calibrate_covariance(record, fit->covariance, 3);
	calibrate_words(record->method,
			"pivot, least squares of %d of %d poses, cone %.0f degrees",
			fit->inliers, fit->n, fit->cone_deg);
	calibrate_words(
		record->verdict,
		"residuals %.3f mm rms, within 1 mm, and %.3f mm held out; cone %.0f "
		"degrees, at least %g; %d of %d poses used",
		fit->rms_mm, fit->held_out_mm, fit->cone_deg, INCISE_TIP_CONE_DEG,
		fit->inliers, fit->n);
	calibrate_stated(&tip->common, tip->u_surface_mm, "surface_u_mm", "mm",
			 "Standard uncertainty of the tissue surface of rig.conf along "
			 "its normal");
	return 0;
}

/* --- the report ---------------------------------------------------------------------- */

#define OUTLIERS_LISTED 20

static void print_tip_report(const void *run, FILE *out)
{
	const struct tip *tip = run;
	const struct incise_tip_fit *fit = &tip->fit;
	int listed = 0;

	fprintf(out, "Tip of the blade in the frame of the tracker's sensor\n\n");
	fprintf(out, "Covariance, mm²\n");
	for (int i = 0; i < 3; i++)
		fprintf(out, "  %12.4e %12.4e %12.4e\n", fit->covariance[3 * i],
			fit->covariance[3 * i + 1], fit->covariance[3 * i + 2]);
	fprintf(out,
		"\n"
		"Budget           type  u         sensitivity\n"
		"pose residuals   A     %.4f mm rms, in %s of %d; "
		"the covariance is of these\n"
		"distortion       -     not known; its part that varies with the pose "
		"is in the residuals\n"
		"\n",
		fit->rms_mm, cli_count(fit->blocks, "independent block"), fit->block);
	fprintf(out,
		"%d poses, %d accepted; residuals %.4f mm rms, %.4f mm largest, %.4f "
		"mm rms held out\n"
		"cone %.1f degrees, least turned direction %.1f degrees, condition "
		"%.1f\n"
		"pivot at %.3f %.3f %.3f mm, drift %.4f mm (u %.4f mm)\n",
		fit->n, fit->inliers, fit->rms_mm, fit->largest_mm, fit->held_out_mm,
		fit->cone_deg, fit->least_deg, fit->condition, fit->pivot_mm[0],
		fit->pivot_mm[1], fit->pivot_mm[2], fit->moved_mm, fit->moved_sd_mm);
	if (fit->inliers < fit->n)
		fprintf(out, "left out:");
	for (int i = 0; i < tip->n; i++)
		if (!tip->inlier[i] && listed++ < OUTLIERS_LISTED)
			fprintf(out, " pose %d", i + 1);
	if (listed > OUTLIERS_LISTED)
		fprintf(out, " and %d more", listed - OUTLIERS_LISTED);
	if (listed)
		fputc('\n', out);
}

static json_t *make_tip_json(const void *run)
{
	const struct tip *tip = run;
	json_t *details = json_object(), *outliers = json_array();

	json_set_integer(details, "poses", tip->fit.n);
	json_set_integer(details, "inliers", tip->fit.inliers);
	json_set_integer(details, "blocks", tip->fit.blocks);
	json_set_number(details, "rms_error_mm", tip->fit.rms_mm);
	json_set_number(details, "largest_mm", tip->fit.largest_mm);
	json_set_number(details, "held_out_mm", tip->fit.held_out_mm);
	json_set_number(details, "cone_deg", tip->fit.cone_deg);
	json_set_number(details, "least_deg", tip->fit.least_deg);
	json_set_number(details, "condition", tip->fit.condition);
	json_set_number(details, "moved_mm", tip->fit.moved_mm);
	json_set_number(details, "moved_sd_mm", tip->fit.moved_sd_mm);
	json_object_set_new(details, "covariance_mm2",
			    json_numbers(tip->fit.covariance, 9));
	for (int i = 0; i < tip->n; i++)
		if (!tip->inlier[i])
			json_array_append_new(outliers, json_integer(i + 1));
	json_object_set_new(details, "outliers", outliers);
	return calibrate_json(&tip->common, details);
}

static void put_plot(const struct tip *tip, bool residuals, FILE *script)
{
	bool left_out = tip->fit.inliers < tip->n;
	int n = 0;

	if (residuals)
		fputs("set title 'Residuals of the tip, without poses left out'\n"
		      "set xlabel 'time / s'\nset ylabel 'residual of the tip / mm'\n"
		      "set autoscale xfix\neval key_below\n"
		      "plot for [k=2:4] 'poses.dat' using 1:(int($5) ? column(k) : NaN) "
		      "with points lt k-1 ps 0.35 title word('x y z', k-1)",
		      script);
	else {
		fputs("set title 'Positions of the sensor while the blade turns about its tip'\n"
		      "set size ratio -1\nset xlabel 'x of the sensor / mm'\n"
		      "set ylabel 'y of the sensor / mm'\neval key_below\n",
		      script);
		plot_add(
			script, &n,
			"'poses.dat' using 6:(int($5) ? $7 : NaN) with points lt 1 ps 0.35 "
			"title '%s'",
			left_out ? "used" : "");
		if (left_out)
			plot_add(
				script, &n,
				"'poses.dat' using 6:(int($5) ? NaN : $7) with points lt 2 "
				"pt 2 title 'left out'");
	}
	fputc('\n', script);
}

static void draw_tip_plots(const void *run, const char *folder)
{
	static const char *const plots[] = {"residuals", "fit"};
	const struct tip *tip = run;
	FILE *data = plot_data(folder, "poses.dat"), *script;

	for (int i = 0; i < tip->n; i++) {
		const struct incise_tip_pose *pose = &tip->poses[i];
		double r[3];

		/* R t + p - c */
		v3_rotate(r, pose->quaternion, tip->fit.tip_mm);
		v3_add(r, r, 1, pose->position_mm);
		v3_sub(r, r, tip->fit.pivot_mm);
		fprintf(data, "%.4f %.5f %.5f %.5f %d %.4f %.4f\n",
			(pose->t_ns - tip->poses[0].t_ns) * 1e-9, r[0], r[1], r[2],
			tip->inlier[i], pose->position_mm[0], pose->position_mm[1]);
	}
	plot_data_end(data, folder);
	for (int i = 0; i < 2; i++) {
		script = plot_begin(folder, plots[i], 900, 560);
		put_plot(tip, !i, script);
		calibrate_draw(script, folder, plots[i]);
	}
}

int calibrate_tip(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "tip",
		.command = &command,
		.check = check_tip_options,
		.read = read_poses,
		.measure = record_poses,
		.write = write_poses,
		.fit = fit_tip,
		.text = print_tip_report,
		.json = make_tip_json,
		.draw = draw_tip_plots,
	};
	static struct tip tip = {.u_surface_mm = NAN};

	return calibrate_run(&kind, argc, argv, &tip);
}
