// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate stepper: force per microstep of the actuator, its backlash, hysteresis and
 * stiction, and the largest step rate that loses no step.
 */
#include <math.h>
#include <string.h>
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "stepper.h"
#include "table.h"

struct stepper {
	struct calibrate common;
	bool no_rate;
	double step_mm; /* NAN: not given */
	struct stepper_live live;
	/* The points, in order of time. */
	struct incise_calibrate_stepper_point *points;
	enum incise_calibrate_stepper_state *states;
	double *t_s; /* NAN: not known */
	int n;
	struct incise_calibrate_stepper_setup setup;
	struct incise_calibrate_stepper fit;
	struct stepper_rate rate;
};

static const struct cli_unit lengths[] = {{"mm", 1}, {"um", 1e-3}, {0}};
static const struct cli_unit forces[] = {{"N", 1}, {"mN", 1e-3}, {0}};

static void parse_range(void *run, char *text)
{
	struct stepper_live *live = &((struct stepper *)run)->live;
	char *dots = strstr(text, "..");

	if (!dots)
		cli_usage("--range: expected two positions, for example 0mm..1.5mm, "
			  "found '%.40s'",
			  text);
	*dots = 0;
	live->low_mm = cli_quantity("--range", text, lengths, 0, 1000);
	live->high_mm = cli_quantity("--range", dots + 2, lengths, 0, 1000);
	if (!(live->high_mm > live->low_mm))
		cli_usage("--range: it ends at %g mm, not above its start; give "
			  "FROM..TO, for example 0mm..1.5mm",
			  live->high_mm);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct stepper),
	{0, "from", "FILE",
	 "CSV with position_mm or steps, and force_N, instead of devices",
	 CLI_INPUT(struct stepper, common.from)},
	{'o', "output", "FILE.csv", "write the points as CSV, for --from",
	 CLI_OUTPUT(struct stepper, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct stepper),
	{0, "range", "MM..MM",
	 "range of the strokes, for example 0mm..1.5mm (default: from 0 to 70 % of "
	 "the force channel's range)",
	 CLI_PARSED_BY(parse_range)},
	{0, "repeat", "N", "number of strokes up and down, 2 to 100 (default: 3)",
	 CLI_INTEGER(struct stepper, live.strokes, 2, 100)},
	{0, "max-force", "N",
	 "stop and go back beyond this force (default: 80 % of the force channel's "
	 "range)",
	 CLI_QUANTITY(struct stepper, live.max_N, forces, 0.001, 10000)},
	{0, "no-rate", NULL, "do not look for the largest step rate",
	 CLI_FLAG(struct stepper, no_rate)},
	{0, "step-mm", "MM", "with --from: travel per microstep, in mm",
	 CLI_NUMBER(struct stepper, step_mm, 1e-7, 100)},
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
	.examples = "incise calibrate stepper --range 0mm..1.5mm -o bench",
	.success = "the calibration is active",
	.failure = "failed, refused or stopped",
};

static void check_stepper_options(void *run, int argc, char **argv)
{
	struct stepper *stepper = run;
	const struct calibrate *common = &stepper->common;
	struct stepper_live *live = &stepper->live;

	cli_no_operands(argc, argv, "--from");
	if (!isnan(stepper->step_mm) && !common->from)
		cli_usage("--step-mm goes with --from: a rig knows the travel of a step");
	if (common->from && (common->rig || common->keep || !isnan(live->low_mm) ||
			     !isnan(live->max_N) || live->strokes || stepper->no_rate))
		cli_usage(
			"--from does not go with --rig, -o FILE.csv, --range, --repeat, "
			"--max-force or --no-rate: it drives nothing");
	if (!live->strokes)
		live->strokes = 3;
}

/* Relative uncertainty of the force channel's sensitivity, from the history. */
static void find_sensor_u(struct stepper *stepper)
{
	const struct calibrate *common = &stepper->common;
	const struct incise_calibration_value *v = incise_calibration_last(
		common->history, common->n_history, "force_mV_N", NULL);

	if (v && v->left == common->found.force_mV_N)
		stepper->setup.sensor_u = fmin(0.9, v->u / fabs(v->left));
	else
		cli_warn("%s has no uncertainty of force_mV_N, so 5 %% is assumed; run "
			 "incise calibrate force",
			 common->calibration);
}

/*
 * --- points as CSV: -o writes, --from reads --------------------------------------------
 *
 *     t_s,steps,position_mm,force_N
 */

#define POINTS_MAX 1000000

enum { TIME, STEPS, POSITION, FORCE };

static void add_point(void *run, double t_s, double position_mm, double force_N)
{
	struct stepper *stepper = run;
	const size_t n = stepper->n++;

	stepper->points = cli_grow(stepper->points, n, sizeof(*stepper->points));
	stepper->t_s = cli_grow(stepper->t_s, n, sizeof(*stepper->t_s));
	stepper->t_s[n] = t_s;
	stepper->points[n] =
		(struct incise_calibrate_stepper_point){position_mm, force_N};
}

static bool has_point(const struct table *table)
{
	return table->at[FORCE] >= 0 &&
	       (table->at[POSITION] >= 0 || table->at[STEPS] >= 0);
}

struct stepper_reader {
	struct stepper *stepper;
	bool has_steps, has_both;
	double mm, counted; /* largest travel in both columns */
	double first_mm, first_steps;
};

static void add_stepper_row(void *context, const struct table *table, const double *row)
{
	struct stepper_reader *r = context;
	double mm = row[POSITION], steps = row[STEPS];

	if (!r->stepper->n) {
		r->first_mm = mm;
		r->first_steps = steps;
	}
	r->has_steps = table->at[STEPS] >= 0;
	r->has_both = r->has_steps && table->at[POSITION] >= 0;
	if (fabs(steps - r->first_steps) > r->counted) {
		r->counted = fabs(steps - r->first_steps);
		r->mm = fabs(mm - r->first_mm);
	}
	if (fabs(steps - round(steps)) > 1e-3)
		cli_fail("%s:%d: steps: expected a whole number, found %.6g; see whether "
			 "columns are swapped",
			 table->path, table->line, steps);
	/* From the second position on the ratio of both columns is fixed. */
	if (r->counted > 0 && r->mm > 0 && r->has_both &&
	    fabs(fabs(mm - r->first_mm) -
		 fabs(steps - r->first_steps) * r->mm / r->counted) >
		    1.5 * r->mm / r->counted + 0.01 * r->mm)
		cli_fail(
			"%s:%d: position_mm and steps disagree about the travel of a step; "
			"see whether columns are swapped",
			table->path, table->line);
	if (r->stepper->n == POINTS_MAX)
		cli_fail("%s:%d: more than %d points; keep every tenth", table->path,
			 table->line, POINTS_MAX);
	/* Steps are exact; a position in mm has been rounded. */
	add_point(r->stepper, row[TIME], r->has_steps ? steps : mm, row[FORCE]);
}

static void read_points(void *run, const char *path)
{
	static const struct table_form form = {
		"points",  "force_N, and position_mm or steps",
		"t_s is",  {{"t_s"}, {"steps"}, {"position_mm"}, {"force_N"}},
		has_point,
	};
	struct stepper *stepper = run;
	struct stepper_reader r = {.stepper = stepper};

	find_sensor_u(stepper);
	table_read(path, &form, add_stepper_row, &r);
	if (isnan(stepper->step_mm) && r.counted > 0 && r.has_both)
		stepper->step_mm = r.mm / r.counted;
	if (!(stepper->step_mm > 0))
		cli_fail("%s: the travel of a microstep is not in it; give --step-mm, or "
			 "both columns, steps and position_mm",
			 path);
	for (int i = 0; i < stepper->n && r.has_steps; i++)
		stepper->points[i].position_mm *= stepper->step_mm;
}

static void write_points(const void *run, FILE *out)
{
	const struct stepper *stepper = run;

	fprintf(out, "t_s,steps,position_mm,force_N\n");
	for (int i = 0; i < stepper->n; i++)
		fprintf(out, "%.4f,%lld,%.9g,%.6f\n", stepper->t_s[i],
			llround(stepper->points[i].position_mm / stepper->step_mm),
			stepper->points[i].position_mm, stepper->points[i].force_N);
}

/* The motor keeps its power until the fit. */
static void measure_points(void *run)
{
	struct stepper *stepper = run;
	struct stepper_live *live = &stepper->live;

	find_sensor_u(stepper);
	stepper_begin(live, &stepper->common);
	stepper->step_mm = live->drive.info.step_mm;
	stepper->setup.spring_N_mm = live->drive.info.spring_N_mm;
	stepper->setup.low_N = live->low_N;
	stepper->setup.high_N = live->high_N;
	calibrate_words(stepper->common.record.device, "%s", live->drive.info.name);
	stepper_strokes(live, add_point, stepper);
}

/* --- the fit ------------------------------------------------------------------------- */

static void add_values(struct stepper *stepper)
{
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	const struct stepper_rate *rate = &stepper->rate;
	struct calibrate *common = &stepper->common;

	calibrate_value(common, "stepper_N_step", "N", fit->N_step, fit->N_step_u);
	calibrate_value(common, "stepper_backlash_mm", "mm", fit->backlash_mm,
			fit->backlash_u_mm);
	calibrate_value(common, "stepper_hysteresis_N", "N", fit->hysteresis_N,
			fit->hysteresis_u_N);
	calibrate_value(common, "stepper_stiction_N", "N", fit->stiction_N,
			fit->stiction_u_N);
	/* Uniform between the rate that lost none and the one that did. */
	if (rate->tried && rate->kept_1_s > 0)
		calibrate_value(common, "stepper_steps_s", "1/s", rate->kept_1_s,
				isnan(rate->lost_1_s)
					? 0
					: (rate->lost_1_s - rate->kept_1_s) / sqrt(12));
}

static void set_verdict(struct stepper *stepper)
{
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	const struct incise_calibrate_stepper_setup *setup = &stepper->setup;
	struct incise_calibration_record *record = &stepper->common.record;
	const double off = 100 * (fit->N_mm / setup->spring_N_mm - 1);
	char spring[100] = "";

	if (!isnan(setup->spring_N_mm))
		calibrate_words(spring,
				"; %+.2f %% from the spring's %.4g N/mm, within %g %%",
				off, setup->spring_N_mm, 100 * setup->tolerance);
	if (fit->linearity > setup->linearity)
		calibrate_words(record->verdict,
				"linearity of %.2f %% is more than %g %%", fit->linearity,
				setup->linearity);
	else if (!fit->pass)
		calibrate_words(record->verdict,
				"%.4g N/mm, %+.2f %% from the spring's %.4g N/mm, more "
				"than %g %%",
				fit->N_mm, off, setup->spring_N_mm,
				100 * setup->tolerance);
	else
		calibrate_words(record->verdict, "linearity %.2f %%, within %g %%%s",
				fit->linearity, setup->linearity, spring);
}

static int fit_strokes(void *run, struct incise_error *err)
{
	struct stepper *stepper = run;
	struct incise_calibration_record *record = &stepper->common.record;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	struct stepper_live *live = stepper->common.from ? NULL : &stepper->live;
	int rc;

	stepper->setup.step_mm = stepper->step_mm;
	stepper->states = cli_alloc(stepper->n, sizeof(*stepper->states));
	rc = incise_calibrate_stepper(stepper->points, stepper->n, &stepper->setup,
				      &stepper->fit, stepper->states, err);
	if (rc && live) {
		stepper_creep(live, live->low_mm);
		stepper_drive_rest(&live->drive);
	}
	if (!live)
		stepper->rate.why = "no motor: the data come from a file";
	else if (stepper->no_rate)
		stepper->rate.why = "off by --no-rate";
	else if (!rc)
		stepper_find_rate(live, fit, &stepper->rate);
	if (live)
		stepper_drive_end(&live->drive);
	if (rc)
		return rc;
	add_values(stepper);
	calibrate_words(
		record->method,
		"%d strokes against the force sensor, lines of one slope for both "
		"directions",
		fit->strokes);
	record->low = fit->low_mm;
	record->high = fit->high_mm;
	calibrate_words(record->range_unit, "mm");
	record->pass = fit->pass;
	set_verdict(stepper);
	return 0;
}

/* --- the report ---------------------------------------------------------------------- */

#define LISTED 20 /* outliers, at most */

static const char *const states[] = {"used", "turn", "saturated", "outlier"};

static const char *source_of(const struct stepper *stepper)
{
	return stepper->common.from ? stepper->common.from
				    : stepper->common.record.device;
}

static void print_budget(const struct incise_calibrate_stepper *fit, FILE *out)
{
	fprintf(out,
		"\nUncertainty of N per microstep (k = 1)\n"
		"  %-28s %-4s %-12s %s\n",
		"source", "type", "u", "adds, N/step");
	for (int i = 0; i < fit->budget.n; i++) {
		const struct incise_calibration_part *part = &fit->budget.part[i];

		fprintf(out, "  %-28s %-4c %-9.3g %-2s %.3g\n", part->source, part->type,
			part->u, part->unit, part->contribution);
	}
	fprintf(out, "  %-28s %-17s %.3g   U = %.3g (k = 2), %.2f %%\n", "all", "",
		fit->N_step_u, 2 * fit->N_step_u, 200 * fit->N_step_u / fit->N_step);
}

static void print_rate(const struct stepper_rate *rate, FILE *out)
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

static void print_stepper_report(const void *run, FILE *out)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	char per_mm[UNCERTAINTY_TEXT];
	int listed = 0;

	fprintf(out,
		"%s: %d strokes, %.4g to %.4g mm, %.3f to %.3f N\n"
		"\n"
		"stiffness          %s (k = 2); a step is %.6g mm\n"
		"backlash           no change of force for %.4f mm, %.0f steps; includes "
		"friction at the sensor\n"
		"hysteresis         %s\n",
		source_of(stepper), fit->strokes, fit->low_mm, fit->high_mm, fit->low_N,
		fit->high_N, uncertainty_text(fit->N_mm, 2 * fit->N_mm_u, "N/mm", per_mm),
		stepper->setup.step_mm, fit->dead_mm,
		fit->dead_mm / stepper->setup.step_mm,
		fit->rest_N == 0  ? "below detection limit"
		: fit->rest_N > 0 ? "loss between the two directions"
				  : "force lags after reversals");
	print_rate(&stepper->rate, out);
	fprintf(out,
		"linearity          %.2f %% of full scale; points lie %.2g N off their lines; "
		"strokes %.2g N apart\n",
		fit->linearity, fit->residual_sd_N, fit->drift_N);
	print_budget(fit, out);
	fprintf(out,
		"\n"
		"%s: %d used, %d saturated, %s, %d excluded after "
		"reversals\n",
		cli_count(fit->points, "point"), fit->used, fit->saturated,
		cli_count(fit->outliers, "outlier"),
		fit->points - fit->used - fit->saturated - fit->outliers);
	for (int i = 0; i < stepper->n && listed < LISTED; i++)
		if (stepper->states[i] >= INCISE_CALIBRATE_STEPPER_SATURATED) {
			fprintf(out, "  point %d: %.4f mm, %.4f N: %s\n", i + 1,
				stepper->points[i].position_mm,
				stepper->points[i].force_N, states[stepper->states[i]]);
			listed++;
		}
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

static json_t *make_stepper_json(const void *run)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	json_t *object = json_pack("{so sb so}", "source", json_text(source_of(stepper)),
				   "pass", fit->pass, "verdict",
				   json_text(stepper->common.record.verdict));

	json_set_integer(object, "points", fit->points);
	json_set_integer(object, "used", fit->used);
	json_set_integer(object, "saturated", fit->saturated);
	json_set_integer(object, "outliers", fit->outliers);
	json_set_integer(object, "strokes", fit->strokes);
	json_set_number(object, "N_step", fit->N_step);
	json_set_number(object, "N_step_u", fit->N_step_u);
	json_set_number(object, "N_mm", fit->N_mm);
	json_set_number(object, "N_mm_u", fit->N_mm_u);
	json_set_number(object, "step_mm", stepper->setup.step_mm);
	json_set_number(object, "backlash_mm", fit->backlash_mm);
	json_set_number(object, "backlash_u_mm", fit->backlash_u_mm);
	json_set_number(object, "hysteresis_N", fit->hysteresis_N);
	json_set_number(object, "hysteresis_u_N", fit->hysteresis_u_N);
	json_set_number(object, "stiction_N", fit->stiction_N);
	json_set_number(object, "stiction_u_N", fit->stiction_u_N);
	json_set_number(object, "dead_mm", fit->dead_mm);
	json_set_number(object, "rest_N", fit->rest_N);
	json_set_number(object, "rest_mm", fit->rest_mm);
	json_set_number(object, "branches_mm", fit->branches_mm);
	json_set_number(object, "linearity_percent", fit->linearity);
	json_set_number(object, "low_mm", fit->low_mm);
	json_set_number(object, "high_mm", fit->high_mm);
	json_set_number(object, "low_N", fit->low_N);
	json_set_number(object, "high_N", fit->high_N);
	json_set_number(object, "residual_sd_N", fit->residual_sd_N);
	json_set_number(object, "misfit", fit->misfit);
	json_set_number(object, "drift_N", fit->drift_N);
	json_object_set_new(object, "budget",
			    calibrate_budget(&fit->budget, false, "u_N_step"));
	json_object_set_new(object, "rate", rate_json(&stepper->rate));
	return object;
}

static bool has_state(const struct stepper *stepper, int from, int to)
{
	for (int i = 0; i < stepper->n; i++)
		if ((int)stepper->states[i] >= from && (int)stepper->states[i] <= to)
			return true;
	return false;
}

static void draw_stepper_plots(const struct stepper *stepper, const char *folder)
{
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	FILE *script = plot_begin(folder, "fit", 900, 560);
	int n = 0;

	fprintf(script,
		"set title 'Force of the actuator over its position, and fitted lines'\n"
		"set xlabel 'position / mm'\nset ylabel 'force / N'\neval key_below\n"
		"plot 'points.dat' using 1:($4==1?$2:NaN) with points lt 1 pt 9 title 'up', \\\n"
		"  '' using 1:($4==0?$2:NaN) with points lt 2 pt 11 title 'down', \\\n"
		"  %.9g+%.9g*x lt 1 title 'line, up', %.9g+%.9g*x lt 2 title 'line, down'\n",
		fit->up_N, fit->N_mm, fit->down_N, fit->N_mm);
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the force from the fitted lines'\n"
	      "set xlabel 'position / mm'\nset ylabel 'residual of the force / N'\n"
	      "eval key_below\n",
	      script);
	plot_add(script, &n,
		 "'points.dat' using 1:($5==0?$3:NaN) with points lt 1 title 'used'");
	if (has_state(stepper, INCISE_CALIBRATE_STEPPER_TURN,
		      INCISE_CALIBRATE_STEPPER_TURN))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5==1?$3:NaN) with points lt 8 title 'after a turn'");
	if (has_state(stepper, INCISE_CALIBRATE_STEPPER_SATURATED,
		      INCISE_CALIBRATE_STEPPER_OUTLIER))
		plot_add(
			script, &n,
			"'points.dat' using 1:($5>1?$3:NaN) with points lt 2 pt 2 title 'left out'");
	fputc('\n', script);
	calibrate_draw(script, folder, "residuals");
}

static void draw_report(const void *run, const char *folder)
{
	const struct stepper *stepper = run;
	const struct incise_calibrate_stepper *fit = &stepper->fit;
	FILE *data = plot_data(folder, "points.dat");
	double before = NAN;
	int up = 1;

	for (int i = 0; i < stepper->n; i++) {
		const struct incise_calibrate_stepper_point *p = &stepper->points[i];
		double line;

		if (p->position_mm != before && !isnan(before))
			up = p->position_mm > before;
		before = p->position_mm;
		line = (up ? fit->up_N : fit->down_N) + fit->N_mm * p->position_mm;
		fprintf(data, "%.6f %.6f %.6f %d %d\n", p->position_mm, p->force_N,
			p->force_N - line, up, (int)stepper->states[i]);
	}
	plot_data_end(data, folder);
	draw_stepper_plots(stepper, folder);
}

int calibrate_stepper(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "stepper",
		.command = &command,
		.check = check_stepper_options,
		.read = read_points,
		.measure = measure_points,
		.write = write_points,
		.fit = fit_strokes,
		.text = print_stepper_report,
		.summary = print_stepper_report,
		.json = make_stepper_json,
		.draw = draw_report,
	};
	static struct stepper stepper = {
		.step_mm = NAN,
		.live = {.low_mm = NAN, .high_mm = NAN, .max_N = NAN},
		.rate = {.lost_1_s = NAN},
	};

	incise_calibrate_stepper_init(&stepper.setup);
	return calibrate_run(&kind, argc, argv, &stepper);
}
