// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate stepper: force per microstep of the actuator, its backlash, hysteresis and
 * stiction, and the largest step rate that loses no step.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "calibrate/calibrate_result.h"
#include "calibrate/calibrate_stepper.h"
#include "cli/cli.h"
#include "cli/json.h"

enum { OPT_RANGE = CALIBRATE_OWN, OPT_STROKES, OPT_MAX_FORCE, OPT_NO_RATE, OPT_STEP_MM };

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "read as found, and written (default: calibration.conf)"},
	{CALIBRATE_FROM, "from", "FILE",
	 "CSV with position_mm or steps, and force_N, instead of devices"},
	{CALIBRATE_KEEP, "keep", "FILE", "write the points there as CSV"},
	{CALIBRATE_REPORT, "report", "DIR",
	 "pictures of fit and residuals, report.txt and report.json"},
	{CALIBRATE_DRY_RUN, "dry-run", NULL, "leave the calibration as it is"},
	{CALIBRATE_JSON, "json", NULL, "report as JSON"},
	{OPT_RANGE, "range", "MM..MM",
	 "of the strokes, e.g. 0mm..1.5mm (default: from 0 to 70 % of what\n"
	 "the force channel reads)"},
	{OPT_STROKES, "strokes", "N", "up and down, 2 to 100 (default: 3)"},
	{OPT_MAX_FORCE, "max-force", "N",
	 "stop and go back beyond this (default: 80 % of what the channel\n"
	 "reads)"},
	{OPT_NO_RATE, "no-rate", NULL, "do not search the largest step rate"},
	{OPT_STEP_MM, "step-mm", "MM", "with --from: way of a microstep"},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate stepper",
	.synopsis = "[--from FILE.csv] [OPTIONS]",
	.summary =
		"Drive the actuator up and down against the force sensor, and tell the force of a\n"
		"microstep, backlash, hysteresis, stiction, and the largest step rate that loses\n"
		"no step. The handle is to press the sensor, and nobody is to hold it. Ctrl-C\n"
		"ends with the motor at rest and without power. Not a safety device: keep a hand\n"
		"on the emergency stop.",
	.options = options,
	.notes =
		"Example:\n  incise calibrate stepper --range 0mm..1.5mm --report bench\n\n"
		"Exit: 0 done and in force, 1 failed, refused or stopped, 2 bad usage.\n"
		"See incise-calibrate-stepper(1).",
};

struct job {
	struct calibrate_wish wish;
	bool no_rate;
	double low_mm, high_mm, max_N, step_mm;
	int strokes;
	bool has_strokes;
};

static const struct cli_unit lengths[] = {{"mm", 1}, {"um", 1e-3}, {0}};

static void parse_range(struct job *job, char *text)
{
	char *dots = strstr(text, "..");

	if (!dots)
		cli_usage("--range: expected two places such as 0mm..1.5mm, got '%.40s'",
			  text);
	*dots = 0;
	job->low_mm = cli_quantity("--range", text, lengths, 0, 1000);
	job->high_mm = cli_quantity("--range", dots + 2, lengths, 0, 1000);
	if (!(job->high_mm > job->low_mm))
		cli_usage("--range: it ends at %g mm, where it begins or before",
			  job->high_mm);
}

static void check_options(const struct job *job)
{
	if (!isnan(job->step_mm) && !job->wish.from)
		cli_usage(
			"--step-mm is for --from: a rig says itself how far a step goes");
	if (job->wish.from && (job->wish.rig || job->wish.keep || !isnan(job->low_mm) ||
			       !isnan(job->max_N) || job->has_strokes || job->no_rate))
		cli_usage(
			"--from drives nothing: it does not go with --rig, --keep, --range, "
			"--strokes, --max-force or --no-rate");
}

static void parse(struct job *job, int argc, char **argv)
{
	static const struct cli_unit forces[] = {{"N", 1}, {"mN", 1e-3}, {0}};
	int opt;

	*job = (struct job){.low_mm = NAN,
			    .high_mm = NAN,
			    .max_N = NAN,
			    .step_mm = NAN,
			    .strokes = 3};
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_RANGE:
			parse_range(job, optarg);
			break;
		case OPT_STROKES:
			job->strokes = (int)cli_integer("strokes", optarg, 2, 100);
			job->has_strokes = true;
			break;
		case OPT_MAX_FORCE:
			job->max_N =
				cli_quantity("--max-force", optarg, forces, 0.001, 10000);
			break;
		case OPT_NO_RATE:
			job->no_rate = true;
			break;
		case OPT_STEP_MM:
			job->step_mm = cli_number("step-mm", optarg, 1e-7, 100);
			break;
		default:
			calibrate_option(&job->wish, opt);
		}
	if (optind < argc)
		cli_usage("there is nothing to do with '%s'", argv[optind]);
	check_options(job);
}

/* How sure the force channel's sensitivity is, where the history says it. */
static void find_sensor_u(const struct calibrate_wish *wish, double *sensor_u)
{
	struct incise_calibration_record *records = NULL;
	struct incise_error err = {0};
	int n = incise_calibration_history(wish->calibration, &records, &err);
	bool known = false;

	for (int i = 0; i < n; i++)
		for (int j = 0; j < records[i].n && records[i].pass; j++) {
			const struct incise_calibration_value *v = &records[i].values[j];

			if (strcmp(v->key, "force_mV_N") ||
			    v->left != wish->found.force_mV_N)
				continue;
			*sensor_u = fmin(0.9, v->u / fabs(v->left));
			known = true;
		}
	free(records);
	if (!known)
		cli_warn(
			"how sure force_mV_N is does not stand in %s: taken is 5 %%; run "
			"incise calibrate force",
			wish->calibration);
}

static void fill_record(struct incise_calibration_record *record,
			const struct incise_calibrate_stepper *fit,
			const struct incise_calibrate_stepper_setup *setup,
			const struct stepper_rate *rate,
			const struct incise_calibration *found)
{
	snprintf(record->kind, sizeof(record->kind), "stepper");
	snprintf(
		record->method, sizeof(record->method),
		"%d strokes against the force sensor, lines of one slope, turns told apart",
		fit->strokes);
	calibrate_value(record, "stepper_N_step", "N", found->stepper_N_step, fit->N_step,
			fit->N_step_u);
	calibrate_value(record, "stepper_backlash_mm", "mm", found->stepper_backlash_mm,
			fit->backlash_mm, fit->backlash_u_mm);
	calibrate_value(record, "stepper_hysteresis_N", "N", found->stepper_hysteresis_N,
			fit->hysteresis_N, fit->hysteresis_u_N);
	calibrate_value(record, "stepper_stiction_N", "N", found->stepper_stiction_N,
			fit->stiction_N, fit->stiction_u_N);
	/* Between what kept and what lost, anywhere. */
	if (rate->tried && rate->kept_1_s > 0)
		calibrate_value(record, "stepper_steps_s", "1/s", found->stepper_steps_s,
				rate->kept_1_s,
				isnan(rate->lost_1_s)
					? 0
					: (rate->lost_1_s - rate->kept_1_s) / sqrt(12));
	record->low = fit->low_mm;
	record->high = fit->high_mm;
	snprintf(record->range_unit, sizeof(record->range_unit), "mm");
	record->pass = fit->pass;
	if (fit->linearity > setup->linearity)
		snprintf(record->verdict, sizeof(record->verdict),
			 "linearity of %.2f %% is more than %g %%", fit->linearity,
			 setup->linearity);
	else if (!fit->pass)
		snprintf(record->verdict, sizeof(record->verdict),
			 "%.4g N/mm are more than %g %% off the spring's %.4g N/mm",
			 fit->N_mm, 100 * setup->tolerance, setup->spring_N_mm);
	else
		snprintf(record->verdict, sizeof(record->verdict),
			 "linearity %.2f %% of %g %%%s", fit->linearity, setup->linearity,
			 isnan(setup->spring_N_mm) ? "" : ", and as stiff as the spring");
}

/* Refused: the line says why. What is still powered comes to rest first. */
static _Noreturn void refuse(struct stepper_live *live, const struct incise_error *err)
{
	if (!live)
		cli_fail_with(err);
	stepper_live_creep(live, live->low_mm);
	stepper_drive_rest(&live->drive);
	stepper_drive_end(&live->drive);
	cli_fail_with(err);
}

int main(int argc, char **argv)
{
	struct incise_calibration_record record = {.low = NAN, .high = NAN};
	struct incise_calibrate_stepper_setup setup;
	struct incise_calibrate_stepper fit;
	struct stepper_rate rate = {.lost_1_s = NAN};
	struct stepper_series series = {.step_mm = NAN};
	struct stepper_live live;
	struct incise_error err = {0};
	struct stepper_report report = {.series = &series,
					.fit = &fit,
					.setup = &setup,
					.rate = &rate,
					.record = &record};
	struct job job;

	parse(&job, argc, argv);
	incise_calibrate_stepper_init(&setup);
	calibrate_find(&job.wish);
	find_sensor_u(&job.wish, &setup.sensor_u);
	if (job.wish.from) {
		stepper_series_read(&series, job.wish.from, job.step_mm);
		report.source = job.wish.from;
	} else {
		live = (struct stepper_live){.calibration = job.wish.found,
					     .low_mm = job.low_mm,
					     .high_mm = job.high_mm,
					     .max_N = job.max_N,
					     .strokes = job.strokes};
		stepper_live_open(&live, job.wish.rig);
		stepper_live_plan(&live);
		report.source = live.drive.info.name;
		setup.spring_N_mm = live.drive.info.spring_N_mm;
		setup.low_N = live.low_N;
		setup.high_N = live.high_N;
		snprintf(record.device, sizeof(record.device), "%s",
			 live.drive.info.name);
		stepper_live_start(&live);
		stepper_live_strokes(&live, &series);
		if (job.wish.keep)
			stepper_series_write(&series, job.wish.keep);
	}
	setup.step_mm = series.step_mm;
	if (incise_calibrate_stepper(series.points, series.n, &setup, &fit, series.states,
				     &err))
		refuse(job.wish.from ? NULL : &live, &err);
	if (!job.wish.from) {
		if (!job.no_rate)
			stepper_live_rate(&live, &fit, &rate);
		else
			rate.why = "not asked for";
		stepper_drive_end(&live.drive);
	} else
		rate.why = "a file does not drive";
	fill_record(&record, &fit, &setup, &rate, &job.wish.found);
	if ((job.wish.from || job.wish.keep) &&
	    incise_calibration_raw(&record, job.wish.from ? job.wish.from : job.wish.keep,
				   &err))
		cli_fail_with(&err);
	if (job.wish.report)
		stepper_report_folder(&report, job.wish.report);
	/* Only now: whatever failed before has changed nothing. */
	if (cli_stop)
		cli_fail("%s: nothing has changed", strsignal(cli_stop));
	if (!job.wish.dry_run &&
	    incise_calibration_append(job.wish.calibration, &record, &err))
		cli_fail_with(&err);
	if (job.wish.json)
		json_print(stepper_report_json(&report));
	else {
		stepper_report_text(&report, stdout);
		cli_finish();
	}
	stepper_series_free(&series);
	if (!fit.pass)
		cli_fail("not in force: %s", record.verdict);
	return 0;
}
