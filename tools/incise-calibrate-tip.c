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
#include "calibrate/calibrate.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/recording.h"

#define POLL_NS 10000000LL
#define CHECK_NS 1000000000LL
#define READ 64

/* More would not improve it beyond the tracker's error. */
#define ENOUGH_U_MM 0.02
#define ENOUGH_CONE_DEG 70.0
#define ENOUGH_BLOCKS 300

#define OUTLIERS_LISTED 20

struct options {
	struct calibrate_options common;
	double time_s;	     /* 0: not given */
	double u_surface_mm; /* NAN: not given */
};

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct options, common.rig)},
	{CALIBRATE_FILE_OPTION(struct options)},
	{0, "duration", "TIME",
	 "longest recording (default: 20s); ends earlier when the tip is known "
	 "well enough",
	 CLI_DURATION(struct options, time_s, 1, 600)},
	{0, "u-surface", "MM",
	 "standard uncertainty of the tissue surface of rig.conf along its normal, "
	 "which is not measured: for the uncertainty of depths",
	 CLI_NUMBER(struct options, u_surface_mm, 0, 1000)},
	{0, "from", "FILE",
	 "take the poses from a CSV file or a recording instead of a rig",
	 CLI_INPUT(struct options, common.from)},
	{0, "keep", "FILE", "write the poses to this CSV file, for --from",
	 CLI_OUTPUT(struct options, common.keep), .extensions = ".csv"},
	{0, "report", "DIR",
	 "write report.txt, report.json and plots of the residuals into this "
	 "folder",
	 CLI_OUTPUTS(struct options, common.report)},
	{0, "dry-run", NULL, "do everything except writing calibration.conf",
	 CLI_FLAG(struct options, common.dry_run)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, common.json)},
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
	.examples = "incise calibrate tip --rig rig.conf --duration 20s --report tip",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

/* --- poses -------------------------------------------------------------------------- */

#define COLUMNS 8
#define CSV_MAX 32 /* columns that a file may have */
#define POSES_MAX 1000000

struct list {
	struct incise_tip_pose *poses;
	int n, capacity;
	int doubtful; /* left out: the tracker marked them */
};

static const char *const names[COLUMNS] = {"t_s", "x_mm", "y_mm", "z_mm",
					   "qw",  "qx",	  "qy",	  "qz"};

static struct incise_tip_pose *next_pose(struct list *list)
{
	if (list->n == list->capacity) {
		list->capacity = list->capacity ? 2 * list->capacity : 4096;
		if (list->capacity > 2 * POSES_MAX)
			cli_fail("too many poses; a minute of them is enough");
		list->poses = cli_resize(list->poses, (size_t)list->capacity,
					 sizeof(*list->poses));
	}
	return &list->poses[list->n++];
}

static void add_pose(struct list *list, const struct incise_tracker_sample *sample)
{
	struct incise_tip_pose *pose;

	if (!incise_pose_usable(sample->status)) {
		list->doubtful++;
		return;
	}
	pose = next_pose(list);
	pose->t_ns = sample->t_ns;
	memcpy(pose->position_mm, sample->position_mm, sizeof(pose->position_mm));
	memcpy(pose->quaternion, sample->quaternion, sizeof(pose->quaternion));
}

static void read_recording(struct list *list, const char *path)
{
	struct incise_error err = {0};
	struct incise_recording *recording = recording_open(path);
	struct incise_tracker_sample *samples;
	int n;

	n = incise_recording_poses(recording, &samples, &err);
	if (n < 0)
		cli_fail_with(&err);
	for (int i = 0; i < n; i++)
		add_pose(list, &samples[i]);
	free(samples);
	incise_recording_close(recording);
}

static void find_columns(const char *path, int line, char **fields, int n,
			 int at[COLUMNS])
{
	for (int c = 0; c < COLUMNS; c++) {
		at[c] = calibrate_column(path, line, fields, n, names[c]);
		if (at[c] < 0 && c)
			cli_fail(
				"%s:%d: there is no column '%s'; expected a line of column "
				"names: x_mm, y_mm, z_mm, qw, qx, qy, qz; t_s is optional",
				path, line, names[c]);
	}
}

static void read_csv(struct list *list, const char *path)
{
	struct incise_infile *in = calibrate_open(path);
	char *line, *fields[CSV_MAX];
	int at[COLUMNS], number = 0, columns = 0;

	while (calibrate_line(in, &line)) {
		int n;

		number++;
		if (*line == '#' || !line[strspn(line, " \t\r\n")])
			continue;
		n = calibrate_cut(path, number, line, fields, CSV_MAX, " \t", "");
		if (!columns) {
			find_columns(path, number, fields, n, at);
			columns = n;
			continue;
		}
		calibrate_width(path, number, n, columns);
		double values[COLUMNS] = {list->n};

		for (int c = 0; c < COLUMNS; c++) {
			char *end;

			if (at[c] < 0)
				continue;
			values[c] = incise_decimal(fields[at[c]], &end);
			if (end == fields[at[c]] || end[strspn(end, " \t")] ||
			    !isfinite(values[c]) || (!c && fabs(values[c]) > 1e9))
				cli_fail(
					"%s:%d: %s: expected a number, found '%s'; correct "
					"it",
					path, number, names[c], fields[at[c]]);
		}
		struct incise_tip_pose *pose = next_pose(list);

		pose->t_ns = llround(values[0] * 1e9);
		memcpy(pose->position_mm, values + 1, sizeof(pose->position_mm));
		memcpy(pose->quaternion, values + 4, sizeof(pose->quaternion));
	}
	incise_infile_close(in);
	if (!list->n)
		cli_fail(
			"%s: no poses; expected a line of column names (x_mm, y_mm, z_mm, "
			"qw, qx, qy, qz) and lines of numbers",
			path);
}

static void read_poses(struct list *list, const char *path)
{
	struct stat st;

	if (stat(path, &st) && errno != ENOENT)
		cli_fail("%s: %s", path, strerror(errno));
	/* or a recording of which only NAME.rec.part exists */
	if (S_ISDIR(st.st_mode) || cli_ends_with(path, ".rec"))
		read_recording(list, path);
	else
		read_csv(list, path);
}

static void write_poses(const struct list *list, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n");
	for (int i = 0; i < list->n; i++) {
		const struct incise_tip_pose *pose = &list->poses[i];

		fprintf(out, "%.9f", (pose->t_ns - list->poses[0].t_ns) * 1e-9);
		for (int k = 0; k < 3; k++)
			fprintf(out, ",%.17g", pose->position_mm[k]);
		for (int k = 0; k < 4; k++)
			fprintf(out, ",%.17g", pose->quaternion[k]);
		putc('\n', out);
	}
	whole_file_end(file);
}

/* --- live ---------------------------------------------------------------------------- */

static double largest_u(const struct incise_tip_fit *fit)
{
	return sqrt(
		fmax(fit->covariance[0], fmax(fit->covariance[4], fit->covariance[8])));
}

/* Print the progress. Returns whether the tip is known well enough. */
static bool check_progress(const struct list *list)
{
	struct incise_tip_fit fit;
	struct incise_error err = {0};
	int rc = incise_calibrate_tip(list->poses, list->n, NULL, &fit, &err);

	cli_progress("%d poses, cone %.0f of %g degrees, rms %.3f mm, U %.3f mm%s%s",
		     fit.n, fit.cone_deg, INCISE_TIP_CONE_DEG, fit.rms_mm,
		     2 * largest_u(&fit), rc ? ": " : "", rc ? err.text : "");
	return !rc && fit.cone_deg >= ENOUGH_CONE_DEG && fit.blocks >= ENOUGH_BLOCKS &&
	       2 * largest_u(&fit) < ENOUGH_U_MM;
}

static void record_poses(const struct options *options, struct list *list,
			 char device[64])
{
	struct incise_tracker_info info;
	struct incise_rig *rig = cli_open_rig(options->common.rig, INCISE_RIG_TRACKER);
	double time_s = options->time_s > 0 ? options->time_s : 20;
	struct incise_tracker_sample samples[READ];
	struct incise_clock *clock;
	int64_t now, end, next_check;
	bool enough = false;
	int station = 0;

	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Put the tip into its dimple and press Enter; then rotate the "
			"tool in all directions. ");
		while (getchar() != '\n' && !feof(stdin) && !cli_stop)
			;
	}
	incise_tracker_info(incise_rig_tracker(rig), &info);
	station = info.scalpel_station;
	snprintf(device, 64, "%s", info.name);
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
				add_pose(list, &samples[i]);
		}
		if (now >= next_check) {
			enough = check_progress(list);
			next_check += CHECK_NS;
		}
	}
	cli_progress_end();
	incise_rig_close(rig);
	if (cli_stop)
		cli_fail("stopped; the previous calibration stays active");
}

/* --- the report ---------------------------------------------------------------------- */

static void residual(const struct incise_tip_fit *fit, const struct incise_tip_pose *pose,
		     double r[3])
{
	const double *q = pose->quaternion, *t = fit->tip_mm;
	double u[3], w[3];

	/* p + R t - c; with u = 2 v × t the turn is t + w u + v × u */
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		u[i] = 2 * (q[1 + j] * t[k] - q[1 + k] * t[j]);
	}
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		w[i] = q[1 + j] * u[k] - q[1 + k] * u[j];
		r[i] = pose->position_mm[i] + t[i] + q[0] * u[i] + w[i] -
		       fit->pivot_mm[i];
	}
}

static void put_plot(FILE *script, bool residuals, bool left_out)
{
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

static void draw(const char *folder, const struct list *list, const bool *inlier,
		 const struct incise_tip_fit *fit)
{
	static const char *const plots[] = {"residuals", "fit"};
	bool left_out = false;
	FILE *data, *script;

	if (!calibrate_can_plot(folder))
		return;
	data = plot_data(folder, "poses.dat");
	for (int i = 0; i < list->n; i++) {
		double r[3];

		residual(fit, &list->poses[i], r);
		left_out |= !inlier[i];
		fprintf(data, "%.4f %.5f %.5f %.5f %d %.4f %.4f\n",
			(list->poses[i].t_ns - list->poses[0].t_ns) * 1e-9, r[0], r[1],
			r[2], inlier[i], list->poses[i].position_mm[0],
			list->poses[i].position_mm[1]);
	}
	plot_data_end(data, folder);
	for (int i = 0; i < 2; i++) {
		script = plot_begin(folder, plots[i], 900, 560);
		put_plot(script, !i, left_out);
		if (!plot_draw(script, folder, plots[i]))
			cli_warn("%s.png could not be drawn", plots[i]);
	}
}

static void write_report(const struct calibrate_options *common, const struct list *list,
			 const bool *inlier, const struct incise_tip_fit *fit,
			 const struct incise_calibration_record *record)
{
	struct incise_outfile *file;
	FILE *out = calibrate_report_text(common->report, &file);
	int listed = 0;

	if (!out)
		return;
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
	for (int i = 0; i < list->n; i++)
		if (!inlier[i] && listed++ < OUTLIERS_LISTED)
			fprintf(out, " pose %d", i + 1);
	if (listed > OUTLIERS_LISTED)
		fprintf(out, " and %d more", listed - OUTLIERS_LISTED);
	if (listed)
		fputc('\n', out);
	calibrate_result_text(common, record, out);
	whole_file_end(file);
	draw(common->report, list, inlier, fit);
}

static json_t *details(const struct list *list, const bool *inlier,
		       const struct incise_tip_fit *fit)
{
	json_t *outliers = json_array();

	for (int i = 0; i < list->n; i++)
		if (!inlier[i])
			json_array_append_new(outliers, json_integer(i + 1));
	return json_pack(
		"{si si si so so so so so so so so so so}", "poses", fit->n, "inliers",
		fit->inliers, "blocks", fit->blocks, "rms_error_mm",
		json_number(fit->rms_mm), "largest_mm", json_number(fit->largest_mm),
		"held_out_mm", json_number(fit->held_out_mm), "cone_deg",
		json_number(fit->cone_deg), "least_deg", json_number(fit->least_deg),
		"condition", json_number(fit->condition), "moved_mm",
		json_number(fit->moved_mm), "moved_sd_mm", json_number(fit->moved_sd_mm),
		"covariance_mm2", json_numbers(fit->covariance, 9), "outliers", outliers);
}

static void fill_record(const struct incise_calibration *found,
			const struct incise_tip_fit *fit,
			struct incise_calibration_record *record)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};

	for (int i = 0; i < 3; i++)
		calibrate_value(record, keys[i], "mm", found->tip_mm[i], fit->tip_mm[i],
				sqrt(fit->covariance[4 * i]));
	for (int i = 0; i < 3; i++)
		for (int j = 0; j <= i; j++)
			record->covariance[record->n_covariance++] =
				fit->covariance[3 * i + j];
	snprintf(record->method, sizeof(record->method),
		 "pivot, least squares of %d of %d poses, cone %.0f degrees",
		 fit->inliers, fit->n, fit->cone_deg);
	snprintf(record->verdict, sizeof(record->verdict),
		 "residuals %.3f mm rms, within 1 mm, and %.3f mm held out; cone %.0f "
		 "degrees, at least %g; %d of %d poses used",
		 fit->rms_mm, fit->held_out_mm, fit->cone_deg, INCISE_TIP_CONE_DEG,
		 fit->inliers, fit->n);
}

static void parse(struct options *options, int argc, char **argv)
{
	bool timed;

	cli_parse(&command, argc, argv, options);
	timed = options->time_s > 0;
	cli_no_operands(argc, argv, "--from");
	if (options->common.from && timed)
		cli_usage("--duration does not go with --from: the file has its own");
	if (!options->common.from && !timed && !isatty(STDIN_FILENO))
		cli_usage("missing --duration or --from (needed without a terminal)");
	calibrate_begin(&options->common);
}

int main(int argc, char **argv)
{
	struct incise_calibration_record record = {
		.kind = "tip", .low = NAN, .high = NAN, .pass = true};
	struct options options = {.u_surface_mm = NAN};
	struct calibrate_options *common = &options.common;
	struct incise_tip_fit fit;
	struct incise_error err = {0};
	struct list list = {0};
	const char *raw;
	bool *inlier;

	parse(&options, argc, argv);
	raw = common->keep ? common->keep : common->from;
	cli_catch_signals();
	if (common->from)
		read_poses(&list, common->from);
	else
		record_poses(&options, &list, record.device);
	if (common->keep)
		write_poses(&list, common->keep);
	inlier = cli_alloc((size_t)list.n, sizeof(*inlier));
	if (incise_calibrate_tip(list.poses, list.n, inlier, &fit, &err))
		cli_fail_with(&err);
	if (list.doubtful)
		cli_warn("left out %s that the tracker marks as doubtful",
			 cli_count(list.doubtful, "sample"));
	fill_record(&common->found, &fit, &record);
	calibrate_stated(common, &record, options.u_surface_mm, "surface_u_mm", "mm",
			 "Standard uncertainty of the tissue surface of rig.conf along "
			 "its normal");
	/* a recording is a folder, and has its own checksums */
	if (raw && incise_calibration_raw(&record, raw, &err))
		snprintf(record.raw, sizeof(record.raw), "%s", raw);
	write_report(common, &list, inlier, &fit, &record);
	calibrate_end(common, &record, details(&list, inlier, &fit));
	free(list.poses);
	free(inlier);
	return 0;
}
