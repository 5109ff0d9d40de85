// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate force: sensitivity of the force channel, from weights.
 */
#include <math.h>
#include "calibrate/force.h"

static void parse_gravity(void *run, char *text)
{
	struct incise_calibrate_force_setup *setup = &((struct force *)run)->setup;

	setup->gravity_m_s2 = cli_number("gravity", text, 9.7, 9.9);
	setup->gravity_u_m_s2 = 1e-4; /* 10 mGal */
	((struct force *)run)->gravity = "given, to 10 mGal";
}

static void parse_density(void *run, char *text)
{
	struct incise_calibrate_force_setup *setup = &((struct force *)run)->setup;

	setup->weight_kg_m3 = cli_number("density", text, 100, 25000);
	setup->weight_u_kg_m3 = 0.05 * setup->weight_kg_m3;
}

static void parse_tolerance(void *tolerance, char *text)
{
	*(double *)tolerance = cli_number("tolerance", text, 0.001, 100) / 100;
}

static void parse_range(void *run, char *text)
{
	struct force *force = run;
	char *item[2];

	if (cli_list("input-range", text, item, 2) != 2)
		cli_usage("--input-range: expected two voltages in mV, the lower one "
			  "first, for example 0,5000");
	force->setup.low_mV = cli_number("input-range", item[0], -1e6, 1e6);
	force->setup.high_mV = cli_number("input-range", item[1], -1e6, 1e6);
	if (!(force->setup.low_mV < force->setup.high_mV))
		cli_usage("--input-range: expected the lower voltage first, for "
			  "example 0,5000");
	force->ranged = true;
}

static const struct cli_unit grams[] = {{"g", 1}, {"mg", 1e-3}, {"kg", 1e3}, {0}};

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct force),
	{0, "from", "FILE",
	 "pairs instead of a rig: CSV with mass_g or force_N, reading_mV, and "
	 "optionally series and direction (up, down)",
	 CLI_INPUT(struct force, common.from)},
	{0, "keep", "FILE", "write the pairs to this file, for --from",
	 CLI_OUTPUT(struct force, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct force),
	{0, "weights", "LIST",
	 "loads, for example 0,50g,100g,0.2kg (default: ask for them)",
	 CLI_PARSED(struct force, weights, weights_parse)},
	{0, "series", "N",
	 "series of all loads upwards; the last one also downwards (default: 3)",
	 CLI_INTEGER(struct force, weights.series, 1, 100)},
	{0, "duration", "TIME", "averaging time of each reading (default: 2s)",
	 CLI_DURATION(struct force, weights.mean_s, 0.1, 600)},
	{0, "timeout", "TIME",
	 "longest wait for a load to be put on and be steady (default: 1min)",
	 CLI_DURATION(struct force, weights.timeout_s, 2, 3600)},
	{0, "gravity", "M_S2",
	 "local gravity (default: 9.80665, with the uncertainty of an unknown "
	 "place)",
	 CLI_PARSED_BY(parse_gravity)},
	{0, "latitude", "DEG", "latitude, to compute gravity from",
	 CLI_NUMBER(struct force, latitude_deg, -90, 90)},
	{0, "altitude", "M",
	 "altitude above the sea, to compute gravity from (default: 0)",
	 CLI_NUMBER(struct force, altitude_m, -1000, 10000)},
	{0, "scale", "MASS",
	 "resolution of the scale that weighed the loads (default: 0.5g)",
	 CLI_QUANTITY(struct force, setup.scale_g, grams, 0, 1e4)},
	{0, "density", "KG_M3", "density of the weights (default: 7950)",
	 CLI_PARSED_BY(parse_density)},
	{0, "input-range", "LOW,HIGH",
	 "range of the converter in mV (default: that of the rig; unknown with "
	 "--from)",
	 CLI_PARSED_BY(parse_range)},
	{0, "nominal", "MV_N", "nominal sensitivity to compare with (default: 1240)",
	 CLI_NUMBER(struct force, setup.nominal_mV_N, 1, 1e5)},
	{0, "tolerance", "PERCENT", "largest deviation from it that passes (default: 5)",
	 CLI_PARSED(struct force, setup.tolerance, parse_tolerance)},
	{0, "zero", NULL,
	 "also calibrate the zero (default: measured at the start of each "
	 "recording)",
	 CLI_FLAG(struct force, zero)},
	{0}};

static const struct cli_command command = {
	.name = "calibrate force",
	.synopsis = "[--weights LIST | --from FILE] [OPTIONS]",
	.summary = "Measure the sensitivity of the force channel with weights (procedure "
		   "after ISO 376) and write it to calibration.conf.",
	.options = option_table,
	.success = "the calibration is active (or would be, with --dry-run)",
	.failure = "failed or refused",
};

static void parse_options(struct force *force, int argc, char **argv)
{
	const struct calibrate *common = &force->common;

	cli_negative_numbers(argc, argv);
	cli_parse(&command, argc, argv, force);
	cli_no_operands(argc, argv, "--from");
	if (common->from && (common->rig || force->weights.n || common->keep))
		cli_usage("--from does not go with --rig, --weights or --keep: it "
			  "takes the place of a rig");
	if (!isnan(force->latitude_deg) && force->gravity)
		cli_usage("--gravity and --latitude exclude each other; give one of "
			  "them");
	cli_catch_signals();
}

/* Gravity of the place, and its source for the report. */
static void find_gravity(struct force *force)
{
	static char words[80];

	if (!isnan(force->latitude_deg)) {
		force->setup.gravity_m_s2 =
			incise_calibrate_gravity(force->latitude_deg, force->altitude_m);
		force->setup.gravity_u_m_s2 = 5e-4;
		snprintf(words, sizeof(words), "WGS 84 at %g degrees, %g m",
			 force->latitude_deg, force->altitude_m);
		force->gravity = words;
	} else if (!force->gravity) {
		force->gravity = "for anywhere on Earth (--latitude says where)";
	}
}

static int fit_force(void *run, struct incise_error *err)
{
	struct force *force = run;
	const struct incise_calibrate_force *result = &force->result;
	struct incise_calibration_record *record = &force->common.record;
	int rc;

	calibrate_words(
		record->method,
		"weights, procedure after ISO 376; weighted line, outliers by least "
		"median of squares");
	force->states = cli_alloc(force->n, sizeof(*force->states));
	rc = incise_calibrate_force(force->pairs, force->n, &force->setup, &force->result,
				    force->states, err);
	if (rc)
		return rc;
	calibrate_value(&force->common, "force_mV_N", "mV/N", result->sensitivity_mV_N,
			result->sensitivity_u_mV_N);
	if (force->zero)
		calibrate_value(&force->common, "force_zero_mV", "mV", result->zero_mV,
				result->zero_u_mV);
	record->covariance[0] = pow(result->sensitivity_u_mV_N, 2);
	record->covariance[1] = result->covariance;
	record->covariance[2] = pow(result->zero_u_mV, 2);
	record->n_covariance = force->zero ? 3 : 1;
	record->low = result->low_N;
	record->high = result->high_N;
	calibrate_words(record->range_unit, "N");
	record->pass = result->pass;
	calibrate_words(
		record->verdict,
		"%+.2f %% from the nominal %g mV/N, %s %g %%; U = %.2f mV/N (k = 2); "
		"linearity %.2g %%",
		100 * (result->sensitivity_mV_N / force->setup.nominal_mV_N - 1),
		force->setup.nominal_mV_N, result->pass ? "within" : "more than",
		100 * force->setup.tolerance, 2 * result->sensitivity_u_mV_N,
		result->linearity);
	return 0;
}

int main(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "force",
		.read = force_read,
		.measure = force_measure,
		.write = force_write,
		.fit = fit_force,
		.reports_refusal = true,
		.text = force_text,
		.summary = force_summary,
		.json = force_json,
		.draw = force_draw,
	};
	static struct force force = {
		.latitude_deg = NAN,
		.weights = {.series = 3, .mean_s = 2, .timeout_s = 60},
	};

	incise_calibrate_force_init(&force.setup);
	parse_options(&force, argc, argv);
	find_gravity(&force);
	return calibrate_run(&kind, &force);
}
