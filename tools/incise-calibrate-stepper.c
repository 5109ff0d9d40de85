// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate stepper: force per microstep of the actuator, its backlash, hysteresis and
 * stiction, and the largest step rate that loses no step.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "calibrate/calibrate.h"
#include "calibrate/stepper.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/uncertainty.h"

struct options {
	struct calibrate_options common;
	bool no_rate;
	double low_mm, high_mm, max_N, step_mm; /* NAN: not given */
	int strokes;				/* 0: not given */
};

static const struct cli_unit lengths[] = {{"mm", 1}, {"um", 1e-3}, {0}};
static const struct cli_unit forces[] = {{"N", 1}, {"mN", 1e-3}, {0}};

static void parse_range(void *whole, char *text)
{
	struct options *options = whole;
	char *dots = strstr(text, "..");

	if (!dots)
		cli_usage("--range: expected two positions, for example 0mm..1.5mm, "
			  "found '%.40s'",
			  text);
	*dots = 0;
	options->low_mm = cli_quantity("--range", text, lengths, 0, 1000);
	options->high_mm = cli_quantity("--range", dots + 2, lengths, 0, 1000);
	if (!(options->high_mm > options->low_mm))
		cli_usage("--range: it ends at %g mm, not above its start; give "
			  "FROM..TO, for example 0mm..1.5mm",
			  options->high_mm);
}

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct options, common.rig)},
	{CALIBRATE_FILE_OPTION(struct options)},
	{0, "from", "FILE",
	 "CSV with position_mm or steps, and force_N, instead of devices",
	 CLI_INPUT(struct options, common.from)},
	{0, "keep", "FILE", "write the points to this CSV file, for --from",
	 CLI_OUTPUT(struct options, common.keep), .extensions = ".csv"},
	{0, "report", "DIR",
	 "write report.txt, report.json and plots of fit and residuals into this "
	 "folder",
	 CLI_OUTPUTS(struct options, common.report)},
	{0, "dry-run", NULL, "do everything except writing calibration.conf",
	 CLI_FLAG(struct options, common.dry_run)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, common.json)},
	{0, "range", "MM..MM",
	 "range of the strokes, for example 0mm..1.5mm (default: from 0 to 70 % of "
	 "the force channel's range)",
	 CLI_PARSED_BY(parse_range)},
	{0, "strokes", "N", "number of strokes up and down, 2 to 100 (default: 3)",
	 CLI_INTEGER(struct options, strokes, 2, 100)},
	{0, "max-force", "N",
	 "stop and go back beyond this force (default: 80 % of the force channel's "
	 "range)",
	 CLI_QUANTITY(struct options, max_N, forces, 0.001, 10000)},
	{0, "no-rate", NULL, "do not look for the largest step rate",
	 CLI_FLAG(struct options, no_rate)},
	{0, "step-mm", "MM", "with --from: travel per microstep, in mm",
	 CLI_NUMBER(struct options, step_mm, 1e-7, 100)},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate stepper",
	.synopsis = "[--from FILE.csv] [OPTIONS]",
	.summary =
		"Drive the actuator up and down against the force sensor, and measure the "
		"force per microstep, backlash, hysteresis, stiction, and the largest "
		"step rate that loses no step. Let the handle press on the sensor, and do "
		"not hold it. Ctrl-C ends with the motor at rest and without power. Not a "
		"safety device: keep a hand on the emergency stop.",
	.options = option_table,
	.examples = "incise calibrate stepper --range 0mm..1.5mm --report bench",
	.success = "the calibration is active",
	.failure = "failed, refused or stopped",
};

static void parse(struct options *options, int argc, char **argv)
{
	const struct calibrate_options *common = &options->common;

	*options = (struct options){
		.low_mm = NAN, .high_mm = NAN, .max_N = NAN, .step_mm = NAN};
	cli_parse(&command, argc, argv, options);
	cli_no_operands(argc, argv, "--from");
	if (!isnan(options->step_mm) && !common->from)
		cli_usage("--step-mm goes with --from: a rig knows the travel of a step");
	if (common->from &&
	    (common->rig || common->keep || !isnan(options->low_mm) ||
	     !isnan(options->max_N) || options->strokes || options->no_rate))
		cli_usage("--from does not go with --rig, --keep, --range, --strokes, "
			  "--max-force or --no-rate: it drives nothing");
	if (!options->strokes)
		options->strokes = 3;
}

/*
 * --- points as CSV: --keep writes, --from reads ----------------------------------------
 *
 *     t_s,steps,position_mm,force_N
 */

#define COLUMNS 32
#define POINTS_MAX 1000000

static void free_series(struct stepper_series *series)
{
	free(series->points);
	free(series->t_s);
	free(series->states);
	*series = (struct stepper_series){0};
}

struct reader {
	const char *path;
	int line, columns, position, steps, force, time; /* -1: no such column */
	double mm, counted; /* largest travel in both columns */
	double first_mm, first_steps;
};

static void read_header(struct reader *r, char **columns)
{
	int n = r->columns;

	r->position = calibrate_column(r->path, r->line, columns, n, "position_mm");
	r->steps = calibrate_column(r->path, r->line, columns, n, "steps");
	r->force = calibrate_column(r->path, r->line, columns, n, "force_N");
	r->time = calibrate_column(r->path, r->line, columns, n, "t_s");
	if (r->force < 0 || (r->position < 0 && r->steps < 0))
		cli_fail(
			"%s:%d: expected a line of column names: force_N, and position_mm "
			"or steps; t_s is optional",
			r->path, r->line);
}

static double number(const struct reader *r, char **columns, int i, const char *name)
{
	char *end;
	double value;

	if (i < 0)
		return NAN;
	value = incise_decimal(columns[i], &end);
	if (!*columns[i] || *end || !isfinite(value))
		cli_fail("%s:%d: %s: expected a number, found '%.20s'; correct it",
			 r->path, r->line, name, columns[i]);
	return value;
}

static void read_point(struct reader *r, char **columns, struct stepper_series *series)
{
	double mm = number(r, columns, r->position, "position_mm");
	double steps = number(r, columns, r->steps, "steps");

	if (!series->n) {
		r->first_mm = mm;
		r->first_steps = steps;
	}
	if (fabs(steps - r->first_steps) > r->counted) {
		r->counted = fabs(steps - r->first_steps);
		r->mm = fabs(mm - r->first_mm);
	}
	if (fabs(steps - round(steps)) > 1e-3)
		cli_fail("%s:%d: steps: expected a whole number, found %.6g; see whether "
			 "columns are swapped",
			 r->path, r->line, steps);
	/* From the second position on the ratio of both columns is fixed. */
	if (r->counted > 0 && r->mm > 0 && r->position >= 0 &&
	    fabs(fabs(mm - r->first_mm) -
		 fabs(steps - r->first_steps) * r->mm / r->counted) >
		    1.5 * r->mm / r->counted + 0.01 * r->mm)
		cli_fail(
			"%s:%d: position_mm and steps disagree about the travel of a step; "
			"see whether columns are swapped",
			r->path, r->line);
	if (series->n == POINTS_MAX)
		cli_fail("%s:%d: more than %d points; keep every tenth", r->path, r->line,
			 POINTS_MAX);
	/* Steps are exact; a position in mm has been rounded. */
	stepper_series_add(series, number(r, columns, r->time, "t_s"),
			   r->steps >= 0 ? steps : mm,
			   number(r, columns, r->force, "force_N"));
}

static void read_series(struct stepper_series *series, const char *path, double step_mm)
{
	struct reader r = {.path = path};
	char *line, *columns[COLUMNS];
	struct incise_infile *in = calibrate_open(path);
	bool header = true;

	*series = (struct stepper_series){0};
	while (calibrate_line(in, &line)) {
		int n;

		r.line++;
		if (line[strspn(line, " \t\r\n")] == 0 || *line == '#')
			continue;
		n = calibrate_cut(path, r.line, line, columns, COLUMNS, " \t", " \t");
		if (header) {
			r.columns = n;
			read_header(&r, columns);
			header = false;
			continue;
		}
		calibrate_width(path, r.line, n, r.columns);
		read_point(&r, columns, series);
	}
	incise_infile_close(in);
	if (!series->n)
		cli_fail("%s: no points; expected a line of column names (force_N, and "
			 "position_mm or steps) and lines of numbers",
			 path);
	if (r.counted > 0 && r.position >= 0)
		series->step_mm = r.mm / r.counted;
	else
		series->step_mm = step_mm;
	if (!isnan(step_mm))
		series->step_mm = step_mm;
	if (!(series->step_mm > 0))
		cli_fail("%s: the travel of a microstep is not in it; give --step-mm, or "
			 "both columns, steps and position_mm",
			 path);
	for (int i = 0; i < series->n && r.steps >= 0; i++)
		series->points[i].position_mm *= series->step_mm;
}

static void write_series(const struct stepper_series *series, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, "t_s,steps,position_mm,force_N\n");
	for (int i = 0; i < series->n; i++)
		fprintf(out, "%.4f,%lld,%.9g,%.6f\n", series->t_s[i],
			llround(series->points[i].position_mm / series->step_mm),
			series->points[i].position_mm, series->points[i].force_N);
	whole_file_end(file);
}

/* --- the report ---------------------------------------------------------------------- */

struct report {
	const struct stepper_series *series;
	const struct incise_calibrate_stepper *fit;
	const struct incise_calibrate_stepper_setup *setup;
	const struct stepper_rate *rate;
	const struct incise_calibration_record *record;
	const struct calibrate_options *common;
	const char *source; /* device, or file */
};

#define LISTED 20 /* outliers, at most */

static const char *const states[] = {"used", "turn", "saturated", "outlier"};

static void put_budget(const struct incise_calibrate_stepper *fit, FILE *out)
{
	fprintf(out,
		"\nUncertainty of N per microstep (k = 1)\n"
		"  %-28s %-4s %-12s %s\n",
		"source", "type", "u", "adds, N/step");
	for (int i = 0; i < fit->parts; i++) {
		const struct incise_calibrate_stepper_part *part = &fit->part[i];

		fprintf(out, "  %-28s %-4c %-9.3g %-2s %.3g\n", part->source, part->type,
			part->u, part->unit, part->u_N_step);
	}
	fprintf(out, "  %-28s %-17s %.3g   U = %.3g (k = 2), %.2f %%\n", "all", "",
		fit->N_step_u, 2 * fit->N_step_u, 200 * fit->N_step_u / fit->N_step);
}

static void put_rate(const struct stepper_rate *rate, FILE *out)
{
	if (rate->why)
		fprintf(out, "largest step rate  not measured: %s\n", rate->why);
	if (!rate->tried)
		return;
	if (!(rate->kept_1_s > 0))
		fprintf(out,
			"largest step rate  none found: even %.0f /s lost %.4f mm, and "
			"the strokes above were not much slower; check what blocks it\n",
			rate->lost_1_s, rate->lost_mm);
	else if (isnan(rate->lost_1_s))
		fprintf(out,
			"largest step rate  %.0f /s lost no step; this range and "
			"rig.conf allow no faster\n",
			rate->kept_1_s);
	else
		fprintf(out,
			"largest step rate  %.0f /s lost no step; %.0f /s lost %.4f mm; with a "
			"margin of 30 %%: %.0f /s\n",
			rate->kept_1_s, rate->lost_1_s, rate->lost_mm,
			0.7 * rate->kept_1_s);
	fprintf(out, "  %s; detection limit %.4f mm\n",
		cli_count(rate->strokes, "stroke"), rate->seen_mm);
	if (rate->off_mm != 0)
		fprintf(out,
			"  the position count is off by %.4f mm now; run incise "
			"stepper home\n",
			rate->off_mm);
}

static void report_text(const struct report *report, FILE *out)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct stepper_series *series = report->series;
	char per_mm[UNCERTAINTY_TEXT];
	int listed = 0;

	fprintf(out,
		"%s: %d strokes, %.4g to %.4g mm, %.3f to %.3f N\n"
		"\n"
		"stiffness          %s (k = 2); a step is %.6g mm\n"
		"backlash           no change of force for %.4f mm, %.0f steps; includes "
		"friction at the sensor\n"
		"hysteresis         %s\n",
		report->source, fit->strokes, fit->low_mm, fit->high_mm, fit->low_N,
		fit->high_N, uncertainty_text(fit->N_mm, 2 * fit->N_mm_u, "N/mm", per_mm),
		report->setup->step_mm, fit->dead_mm,
		fit->dead_mm / report->setup->step_mm,
		fit->rest_N == 0  ? "below detection limit"
		: fit->rest_N > 0 ? "loss between the two directions"
				  : "force lags after reversals");
	put_rate(report->rate, out);
	fprintf(out,
		"linearity          %.2f %% of full scale; points lie %.2g N off their lines; "
		"strokes %.2g N apart\n",
		fit->linearity, fit->residual_sd_N, fit->drift_N);
	put_budget(fit, out);
	fprintf(out,
		"\n"
		"%s: %d used, %d saturated, %s, %d excluded after "
		"reversals\n",
		cli_count(fit->points, "point"), fit->used, fit->saturated,
		cli_count(fit->outliers, "outlier"),
		fit->points - fit->used - fit->saturated - fit->outliers);
	for (int i = 0; i < series->n && listed < LISTED; i++)
		if (series->states[i] >= INCISE_CALIBRATE_STEPPER_SATURATED) {
			fprintf(out, "  point %d: %.4f mm, %.4f N: %s\n", i + 1,
				series->points[i].position_mm, series->points[i].force_N,
				states[series->states[i]]);
			listed++;
		}
}

static json_t *budget_json(const struct incise_calibrate_stepper *fit)
{
	json_t *list = json_array();

	for (int i = 0; i < fit->parts; i++) {
		const struct incise_calibrate_stepper_part *part = &fit->part[i];

		json_array_append_new(list,
				      json_pack("{ss ss# so ss so}", "source",
						part->source, "type", &part->type, 1, "u",
						json_number(part->u), "unit", part->unit,
						"u_N_step", json_number(part->u_N_step)));
	}
	return list;
}

static json_t *rate_json(const struct stepper_rate *rate)
{
	if (!rate->tried)
		return json_null();
	return json_pack("{so so so so so si so}", "kept_1_s",
			 json_number(rate->kept_1_s), "lost_1_s",
			 json_number(rate->lost_1_s), "lost_mm",
			 json_number(rate->lost_mm), "limit_1_s",
			 json_number(rate->limit_1_s), "seen_mm",
			 json_number(rate->seen_mm), "strokes", rate->strokes, "off_mm",
			 json_number(rate->off_mm));
}

static json_t *report_json(const struct report *report)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct {
		const char *key;
		double value;
	} numbers[] = {
		{"N_step", fit->N_step},
		{"N_step_u", fit->N_step_u},
		{"N_mm", fit->N_mm},
		{"N_mm_u", fit->N_mm_u},
		{"step_mm", report->setup->step_mm},
		{"backlash_mm", fit->backlash_mm},
		{"backlash_u_mm", fit->backlash_u_mm},
		{"hysteresis_N", fit->hysteresis_N},
		{"hysteresis_u_N", fit->hysteresis_u_N},
		{"stiction_N", fit->stiction_N},
		{"stiction_u_N", fit->stiction_u_N},
		{"dead_mm", fit->dead_mm},
		{"rest_N", fit->rest_N},
		{"rest_mm", fit->rest_mm},
		{"branches_mm", fit->branches_mm},
		{"linearity_percent", fit->linearity},
		{"low_mm", fit->low_mm},
		{"high_mm", fit->high_mm},
		{"low_N", fit->low_N},
		{"high_N", fit->high_N},
		{"residual_sd_N", fit->residual_sd_N},
		{"misfit", fit->misfit},
		{"drift_N", fit->drift_N},
	};
	json_t *object =
		json_pack("{so sb so si si si si si}", "source",
			  json_text(report->source), "pass", fit->pass, "verdict",
			  json_text(report->record->verdict), "points", fit->points,
			  "used", fit->used, "saturated", fit->saturated, "outliers",
			  fit->outliers, "strokes", fit->strokes);

	for (size_t i = 0; i < sizeof(numbers) / sizeof(*numbers); i++)
		json_set_number(object, numbers[i].key, numbers[i].value);
	json_object_set_new(object, "budget", budget_json(fit));
	json_object_set_new(object, "rate", rate_json(report->rate));
	return object;
}

static bool has_state(const struct stepper_series *series, int from, int to)
{
	for (int i = 0; i < series->n; i++)
		if ((int)series->states[i] >= from && (int)series->states[i] <= to)
			return true;
	return false;
}

static void draw_report(const struct incise_calibrate_stepper *fit,
			const struct stepper_series *series, const char *folder)
{
	FILE *script = plot_begin(folder, "fit", 900, 560);
	int n = 0;

	fprintf(script,
		"set title 'Force of the actuator over its position, and fitted lines'\n"
		"set xlabel 'position / mm'\nset ylabel 'force / N'\neval key_below\n"
		"plot 'points.dat' using 1:($4==1?$2:NaN) with points lt 1 pt 9 title 'up', \\\n"
		"  '' using 1:($4==0?$2:NaN) with points lt 2 pt 11 title 'down', \\\n"
		"  %.9g+%.9g*x lt 1 title 'line, up', %.9g+%.9g*x lt 2 title 'line, down'\n",
		fit->up_N, fit->N_mm, fit->down_N, fit->N_mm);
	plot_draw_or_fail(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the force from the fitted lines'\n"
	      "set xlabel 'position / mm'\nset ylabel 'residual of the force / N'\n"
	      "eval key_below\n",
	      script);
	plot_add(script, &n,
		 "'points.dat' using 1:($5==0?$3:NaN) with points lt 1 title 'used'");
	if (has_state(series, INCISE_CALIBRATE_STEPPER_TURN,
		      INCISE_CALIBRATE_STEPPER_TURN))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5==1?$3:NaN) with points lt 8 title 'after a turn'");
	if (has_state(series, INCISE_CALIBRATE_STEPPER_SATURATED,
		      INCISE_CALIBRATE_STEPPER_OUTLIER))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5>1?$3:NaN) with points lt 2 pt 2 title 'left out'");
	fputc('\n', script);
	plot_draw_or_fail(script, folder, "residuals");
}

/* FOLDER/fit.png, residuals.png, report.txt, report.json. */
static void write_report(const struct report *report, const char *folder)
{
	const struct incise_calibrate_stepper *fit = report->fit;
	const struct stepper_series *series = report->series;
	struct incise_outfile *file;
	double before = NAN;
	FILE *data, *out;
	int up = 1;

	plot_folder(folder);
	data = plot_data(folder, "points.dat");
	for (int i = 0; i < series->n; i++) {
		const struct incise_calibrate_stepper_point *p = &series->points[i];
		double line;

		if (p->position_mm != before && !isnan(before))
			up = p->position_mm > before;
		before = p->position_mm;
		line = (up ? fit->up_N : fit->down_N) + fit->N_mm * p->position_mm;
		fprintf(data, "%.6f %.6f %.6f %d %d\n", p->position_mm, p->force_N,
			p->force_N - line, up, (int)series->states[i]);
	}
	plot_data_end(data, folder);
	draw_report(fit, series, folder);
	out = calibrate_report_text(folder, &file);
	report_text(report, out);
	calibrate_result_text(report->common, report->record, out);
	whole_file_end(file);
	calibrate_report_json(folder, report_json(report));
}

/* --- the calibration ------------------------------------------------------------------- */

/* Relative uncertainty of the force channel's sensitivity, from the history. */
static void find_sensor_u(const struct calibrate_options *options, double *sensor_u)
{
	struct incise_calibration_record *records = NULL;
	struct incise_error err = {0};
	int n = incise_calibration_history(options->calibration, &records, &err);
	bool known = false;

	for (int i = 0; i < n; i++)
		for (int j = 0; j < records[i].n && records[i].pass; j++) {
			const struct incise_calibration_value *v = &records[i].values[j];

			if (strcmp(v->key, "force_mV_N") ||
			    v->left != options->found.force_mV_N)
				continue;
			*sensor_u = fmin(0.9, v->u / fabs(v->left));
			known = true;
		}
	free(records);
	if (!known)
		cli_warn("%s has no uncertainty of force_mV_N, so 5 %% is assumed; run "
			 "incise calibrate force",
			 options->calibration);
}

static void fill_record(struct incise_calibration_record *record,
			const struct incise_calibrate_stepper *fit,
			const struct incise_calibrate_stepper_setup *setup,
			const struct stepper_rate *rate,
			const struct incise_calibration *found)
{
	char spring[100] = "";

	if (!isnan(setup->spring_N_mm))
		snprintf(spring, sizeof(spring),
			 "; %+.2f %% from the spring's %.4g N/mm, within %g %%",
			 100 * (fit->N_mm / setup->spring_N_mm - 1), setup->spring_N_mm,
			 100 * setup->tolerance);
	snprintf(record->kind, sizeof(record->kind), "stepper");
	snprintf(record->method, sizeof(record->method),
		 "%d strokes against the force sensor, lines of one slope for both "
		 "directions",
		 fit->strokes);
	calibrate_value(record, "stepper_N_step", "N", found->stepper_N_step, fit->N_step,
			fit->N_step_u);
	calibrate_value(record, "stepper_backlash_mm", "mm", found->stepper_backlash_mm,
			fit->backlash_mm, fit->backlash_u_mm);
	calibrate_value(record, "stepper_hysteresis_N", "N", found->stepper_hysteresis_N,
			fit->hysteresis_N, fit->hysteresis_u_N);
	calibrate_value(record, "stepper_stiction_N", "N", found->stepper_stiction_N,
			fit->stiction_N, fit->stiction_u_N);
	/* Uniform between the rate that lost none and the one that did. */
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
			 "%.4g N/mm, %+.2f %% from the spring's %.4g N/mm, more than "
			 "%g %%",
			 fit->N_mm, 100 * (fit->N_mm / setup->spring_N_mm - 1),
			 setup->spring_N_mm, 100 * setup->tolerance);
	else
		snprintf(record->verdict, sizeof(record->verdict),
			 "linearity %.2f %%, within %g %%%s", fit->linearity,
			 setup->linearity, spring);
}

/* Fail with the reason; a powered motor comes to rest first. */
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
	struct options options;
	struct report report = {.series = &series,
				.fit = &fit,
				.setup = &setup,
				.rate = &rate,
				.record = &record,
				.common = &options.common};

	parse(&options, argc, argv);
	incise_calibrate_stepper_init(&setup);
	calibrate_find(&options.common);
	find_sensor_u(&options.common, &setup.sensor_u);
	if (options.common.from) {
		read_series(&series, options.common.from, options.step_mm);
		report.source = options.common.from;
	} else {
		live = (struct stepper_live){.calibration = options.common.found,
					     .low_mm = options.low_mm,
					     .high_mm = options.high_mm,
					     .max_N = options.max_N,
					     .strokes = options.strokes};
		stepper_live_open(&live, options.common.rig);
		stepper_live_plan(&live);
		report.source = live.drive.info.name;
		setup.spring_N_mm = live.drive.info.spring_N_mm;
		setup.low_N = live.low_N;
		setup.high_N = live.high_N;
		snprintf(record.device, sizeof(record.device), "%s",
			 live.drive.info.name);
		stepper_live_start(&live);
		stepper_live_strokes(&live, &series);
		if (options.common.keep)
			write_series(&series, options.common.keep);
	}
	setup.step_mm = series.step_mm;
	if (incise_calibrate_stepper(series.points, series.n, &setup, &fit, series.states,
				     &err))
		refuse(options.common.from ? NULL : &live, &err);
	if (!options.common.from) {
		if (!options.no_rate)
			stepper_live_rate(&live, &fit, &rate);
		else
			rate.why = "off by --no-rate";
		stepper_drive_end(&live.drive);
	} else
		rate.why = "no motor: the data come from a file";
	fill_record(&record, &fit, &setup, &rate, &options.common.found);
	if ((options.common.from || options.common.keep) &&
	    incise_calibration_raw(&record,
				   options.common.from ? options.common.from
						       : options.common.keep,
				   &err))
		cli_fail_with(&err);
	if (options.common.report)
		write_report(&report, options.common.report);
	/* Everything that can fail comes before the calibration changes. */
	calibrate_append(&options.common, &record);
	if (options.common.json) {
		json_print(report_json(&report));
	} else {
		report_text(&report, stdout);
		calibrate_result(&options.common, &record);
	}
	free_series(&series);
	calibrate_require_pass(&record);
	return 0;
}
