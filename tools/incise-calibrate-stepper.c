// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate stepper: force per microstep of the actuator, its backlash, hysteresis and
 * stiction, and the largest step rate that loses no step.
 */
#include <math.h>
#include <string.h>
#include "calibrate/stepper.h"

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
	{0, "keep", "FILE", "write the points to this CSV file, for --from",
	 CLI_OUTPUT(struct stepper, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct stepper),
	{0, "range", "MM..MM",
	 "range of the strokes, for example 0mm..1.5mm (default: from 0 to 70 % of "
	 "the force channel's range)",
	 CLI_PARSED_BY(parse_range)},
	{0, "strokes", "N", "number of strokes up and down, 2 to 100 (default: 3)",
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
	.examples = "incise calibrate stepper --range 0mm..1.5mm --report bench",
	.success = "the calibration is active",
	.failure = "failed, refused or stopped",
};

static void parse_options(struct stepper *stepper, int argc, char **argv)
{
	const struct calibrate *common = &stepper->common;
	struct stepper_live *live = &stepper->live;

	cli_parse(&command, argc, argv, stepper);
	cli_no_operands(argc, argv, "--from");
	if (!isnan(stepper->step_mm) && !common->from)
		cli_usage("--step-mm goes with --from: a rig knows the travel of a step");
	if (common->from && (common->rig || common->keep || !isnan(live->low_mm) ||
			     !isnan(live->max_N) || live->strokes || stepper->no_rate))
		cli_usage("--from does not go with --rig, --keep, --range, --strokes, "
			  "--max-force or --no-rate: it drives nothing");
	if (!live->strokes)
		live->strokes = 3;
}

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
		stepper_find_rate(stepper);
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

int main(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "stepper",
		.read = stepper_read,
		.measure = stepper_measure,
		.write = stepper_write,
		.fit = fit_strokes,
		.text = stepper_text,
		.summary = stepper_text,
		.json = stepper_json,
		.draw = stepper_draw,
	};
	static struct stepper stepper = {
		.step_mm = NAN,
		.live = {.low_mm = NAN, .high_mm = NAN, .max_N = NAN},
		.rate = {.lost_1_s = NAN},
	};

	parse_options(&stepper, argc, argv);
	incise_calibrate_stepper_init(&stepper.setup);
	return calibrate_run(&kind, &stepper);
}
