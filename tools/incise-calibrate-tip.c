// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate tip: where the tip of the blade is in the tracker's sensor, from turning
 * the tool about its tip in a dimple.
 */
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_tip.h>
#include <incise/rig.h>
#include "calibrate/calibrate_report.h"
#include "calibrate/calibrate_result.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "calibrate/tip_poses.h"

#define POLL_NS 10000000LL
#define LOOK_NS 1000000000LL
#define READ 64

/* Enough, while it is turned: more would not make it better than the tracker is. */
#define ENOUGH_U_MM 0.02
#define ENOUGH_CONE_DEG 70.0
#define ENOUGH_BLOCKS 300

#define OUTLIERS_LISTED 20

enum { OPT_TIME = CALIBRATE_OWN };

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "read as found, and written (default: calibration.conf)"},
	{OPT_TIME, "time", "TIME",
	 "turn it for so long at most (default: 20s); it ends earlier\n"
	 "when the tip is known well enough"},
	{CALIBRATE_FROM, "from", "FILE",
	 "take poses from a CSV file or a recording, not from a rig"},
	{CALIBRATE_KEEP, "keep", "FILE", "write the poses there, as CSV for --from"},
	{CALIBRATE_REPORT, "report", "DIR",
	 "report.txt, report.json and pictures of the residuals"},
	{CALIBRATE_DRY_RUN, "dry-run", NULL, "do all but write calibration.conf"},
	{CALIBRATE_JSON, "json", NULL, "tell the result as one JSON object"},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate tip",
	.synopsis = "[--rig RIG | --from FILE] [OPTIONS]",
	.summary =
		"Find where the tip of the blade is in the frame of the tracker's sensor. "
		"Put\nthe tip into a dimple that stays where it is, and turn the tool all "
		"ways about\nit, by 60 degrees at least from one side to the other.",
	.options = options,
	.notes = "Example: incise calibrate tip --rig rig.conf --time 20s --report tip\n"
		 "Exit codes: 0 done and in force, 1 failed or refused, 2 bad usage.",
};

static double largest_u(const struct incise_tip_fit *fit)
{
	return sqrt(
		fmax(fit->covariance[0], fmax(fit->covariance[4], fit->covariance[8])));
}

/* Say how far it is; whether that is enough. */
static bool look(const struct tip_list *list)
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

static void take_live(const struct calibrate_wish *wish, double time_s,
		      struct tip_list *list, char device[64])
{
	struct incise_tracker_info info;
	struct incise_error err = {0};
	struct incise_rig *rig =
		incise_rig_open(cli_rig(wish->rig), INCISE_RIG_TRACKER, &err);
	struct incise_tracker_sample samples[READ];
	struct incise_clock *clock;
	int64_t now, end, next_look;
	bool enough = false;
	int station = 0;

	if (!rig)
		cli_fail_with(&err);
	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Put the tip into its dimple. Enter begins; then turn the "
			"tool all ways. ");
		while (getchar() != '\n' && !feof(stdin) && !cli_stop)
			;
	}
	incise_tracker_info(incise_rig_tracker(rig), &info);
	snprintf(device, 64, "%s", info.name);
	clock = incise_rig_clock(rig);
	now = incise_clock_now(clock);
	end = now + llround(time_s * INCISE_NS_PER_S);
	next_look = now + LOOK_NS;
	/* what came before Enter is of no use */
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
				tip_list_add(list, &samples[i]);
		}
		if (now >= next_look) {
			enough = look(list);
			next_look += LOOK_NS;
		}
	}
	cli_progress_end();
	incise_rig_close(rig);
	if (cli_stop)
		cli_fail("stopped; the old calibration stays");
}

/* --- the report ------------------------------------------------------------------------ */

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

static void draw(const struct calibrate_wish *wish, const struct tip_list *list,
		 const bool *inlier, const struct incise_tip_fit *fit)
{
	static const char *const pictures[] = {"residuals", "fit"};
	const char *folder, *name;
	char *path;
	FILE *data, *script;

	if (!plot_possible()) {
		cli_warn("no pictures: gnuplot is not installed, apt-get install "
			 "gnuplot-nox");
		return;
	}
	if (asprintf(&path, "%s/residuals", wish->report) < 0)
		cli_fail("no memory");
	plot_place("report", path, &folder, &name);
	data = plot_data(folder, "poses.dat");
	for (int i = 0; i < list->n; i++) {
		double r[3];

		residual(fit, &list->poses[i], r);
		fprintf(data, "%.4f %.5f %.5f %.5f %d %.4f %.4f\n",
			(list->poses[i].t_ns - list->poses[0].t_ns) * 1e-9, r[0], r[1],
			r[2], inlier[i], list->poses[i].position_mm[0],
			list->poses[i].position_mm[1]);
	}
	plot_data_end(data, folder);
	for (int i = 0; i < 2; i++) {
		script = plot_begin(folder, pictures[i], 900, 500);
		if (!i)
			fprintf(script,
				"set xlabel 'time, s'\nset ylabel 'residual, mm'\n"
				"set key top right\n"
				"plot for [k=2:4] 'poses.dat' using 1:(int($5) ? column(k) : "
				"NaN) with points pt 7 ps 0.3 lc k-1 title "
				"word('x y z', k-1)\n");
		else
			fprintf(script,
				"set size ratio -1\nset xlabel 'x of the sensor, mm'\n"
				"set ylabel 'y of the sensor, mm'\nset key top right\n"
				"plot 'poses.dat' using 6:(int($5) ? $7 : NaN) with points pt "
				"7 ps 0.3 lc 1 title 'believed', '' using 6:(int($5) ? NaN : "
				"$7) with points pt 2 ps 1 lc 2 title 'left out'\n");
		if (!plot_draw(script, folder, pictures[i]))
			cli_warn("%s.png could not be drawn", pictures[i]);
	}
	free(path);
}

static void write_report(const struct calibrate_wish *wish, const struct tip_list *list,
			 const bool *inlier, const struct incise_tip_fit *fit)
{
	static const char axes[] = "xyz";
	struct incise_outfile *file;
	FILE *out = calibrate_report_text(wish->report, &file);
	int listed = 0;

	if (!out)
		return;
	fprintf(out, "Tip of the blade in the frame of the tracker's sensor\n\n");
	for (int i = 0; i < 3; i++)
		fprintf(out, "tip_%c_mm  %10.4f mm  u = %.4f mm  U = %.4f mm (k = 2)\n",
			axes[i], fit->tip_mm[i], sqrt(fit->covariance[4 * i]),
			2 * sqrt(fit->covariance[4 * i]));
	fprintf(out, "\nCovariance, mm²\n");
	for (int i = 0; i < 3; i++)
		fprintf(out, "  %12.4e %12.4e %12.4e\n", fit->covariance[3 * i],
			fit->covariance[3 * i + 1], fit->covariance[3 * i + 2]);
	fprintf(out,
		"\nBudget           type  u of it   sensitivity\n"
		"pose residuals   A     %.4f mm rms, in %d independent blocks of %d; "
		"the covariance is of these\n"
		"distortion       -     not known: what of it changes with the pose is in "
		"the residuals\n\n",
		fit->rms_mm, fit->blocks, fit->block);
	fprintf(out,
		"%d poses, %d believed; residuals %.4f mm rms, %.4f mm largest, %.4f mm "
		"rms held out\n"
		"cone %.1f degrees, least turned direction %.1f degrees, condition %.1f\n"
		"pivot at %.3f %.3f %.3f mm, trend of it %.4f mm (u %.4f mm)\n",
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
	fprintf(out, "\npass\n");
	whole_file_end(file);
	draw(wish, list, inlier, fit);
}

static json_t *details(const struct tip_list *list, const bool *inlier,
		       const struct incise_tip_fit *fit)
{
	json_t *outliers = json_array(), *covariance = json_array();

	for (int i = 0; i < 9; i++)
		json_array_append_new(covariance, json_number(fit->covariance[i]));
	for (int i = 0; i < list->n; i++)
		if (!inlier[i])
			json_array_append_new(outliers, json_integer(i + 1));
	return json_pack(
		"{si si si so so so so so so so so so so}", "poses", fit->n, "inliers",
		fit->inliers, "blocks", fit->blocks, "rms_mm", json_number(fit->rms_mm),
		"largest_mm", json_number(fit->largest_mm), "held_out_mm",
		json_number(fit->held_out_mm), "cone_deg", json_number(fit->cone_deg),
		"least_deg", json_number(fit->least_deg), "condition",
		json_number(fit->condition), "moved_mm", json_number(fit->moved_mm),
		"moved_sd_mm", json_number(fit->moved_sd_mm), "covariance_mm2",
		covariance, "outliers", outliers);
}

static void state(const struct calibrate_wish *wish, const struct incise_tip_fit *fit,
		  struct incise_calibration_record *record)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};

	for (int i = 0; i < 3; i++)
		calibrate_value(record, keys[i], "mm", wish->found.tip_mm[i],
				fit->tip_mm[i], sqrt(fit->covariance[4 * i]));
	for (int i = 0; i < 3; i++)
		for (int j = 0; j <= i; j++)
			record->covariance[record->n_covariance++] =
				fit->covariance[3 * i + j];
	snprintf(record->method, sizeof(record->method),
		 "pivot, least squares of %d of %d poses, cone %.0f degrees",
		 fit->inliers, fit->n, fit->cone_deg);
	snprintf(record->verdict, sizeof(record->verdict),
		 "residuals %.3f mm rms, %.3f mm held out", fit->rms_mm,
		 fit->held_out_mm);
}

int main(int argc, char **argv)
{
	struct incise_calibration_record record = {
		.kind = "tip", .low = NAN, .high = NAN, .pass = true};
	struct calibrate_wish wish = {0};
	struct incise_tip_fit fit;
	struct incise_error err = {0};
	struct tip_list list = {0};
	double time_s = 0;
	bool *inlier;
	int id;

	while ((id = cli_next(&command, argc, argv)) != CLI_END)
		if (!calibrate_option(&wish, id))
			time_s = cli_duration("time", optarg, 1, 600);
	if (optind < argc)
		cli_usage("'%s' is too much: a file goes with --from", argv[optind]);
	if (wish.from && time_s > 0)
		cli_usage("--time: a file has its own");
	if (!wish.from && !(time_s > 0) && !isatty(STDIN_FILENO))
		cli_usage("without a terminal, --time or --from is needed");
	calibrate_begin(&wish);
	cli_catch_signals();
	if (wish.from)
		tip_list_read(&list, wish.from);
	else
		take_live(&wish, time_s > 0 ? time_s : 20, &list, record.device);
	if (wish.keep)
		tip_list_write(&list, wish.keep);
	inlier = calloc((size_t)list.n + 1, sizeof(*inlier));
	if (!inlier)
		cli_fail("no memory");
	if (incise_calibrate_tip(list.poses, list.n, inlier, &fit, &err))
		cli_fail_with(&err);
	if (list.doubtful)
		cli_warn("%d records that the tracker itself doubts were left out",
			 list.doubtful);
	state(&wish, &fit, &record);
	/* a recording is a folder, and has a ledger of its own */
	if ((wish.keep || wish.from) &&
	    incise_calibration_raw(&record, wish.keep ? wish.keep : wish.from, &err))
		snprintf(record.raw, sizeof(record.raw), "%s",
			 wish.keep ? wish.keep : wish.from);
	write_report(&wish, &list, inlier, &fit);
	calibrate_end(&wish, &record, details(&list, inlier, &fit));
	free(list.poses);
	free(inlier);
	return 0;
}
