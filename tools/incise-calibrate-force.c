// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate force: sensitivity of the force channel, from weights.
 */
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/calibration.h>
#include "calibrate/calibrate_force_report.h"
#include "calibrate/calibrate_result.h"
#include "calibrate/calibrate_weights.h"
#include "cli/cli.h"
#include "cli/json.h"

enum {
	OPT_WEIGHTS = CALIBRATE_OWN,
	OPT_SERIES,
	OPT_TIME,
	OPT_TIMEOUT,
	OPT_GRAVITY,
	OPT_LATITUDE,
	OPT_ALTITUDE,
	OPT_SCALE,
	OPT_DENSITY,
	OPT_RANGE,
	OPT_NOMINAL,
	OPT_TOLERANCE,
	OPT_ZERO,
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "rig.conf, or sim:KEY=VALUE,... (default: ./rig.conf, then /etc/incise)"},
	{'c', "calibration", "FILE",
	 "read as found, and written (default: calibration.conf)"},
	{CALIBRATE_FROM, "from", "FILE",
	 "pairs instead of a rig: CSV with mass_g or force_N, reading_mV,\n"
	 "and perhaps series and direction (up, down)"},
	{CALIBRATE_KEEP, "keep", "FILE", "write the pairs there, as --from reads them"},
	{CALIBRATE_REPORT, "report", "DIR", "report.txt, report.json and pictures"},
	{CALIBRATE_DRY_RUN, "dry-run", NULL, "leave the calibration as it is"},
	{CALIBRATE_JSON, "json", NULL, "report as JSON"},
	{OPT_WEIGHTS, "weights", "LIST",
	 "loads such as 0,50g,100g,0.2kg; without it they are asked for"},
	{OPT_SERIES, "series", "N",
	 "times up by all loads, the last one down as well (default: 3)"},
	{OPT_TIME, "time", "TIME", "mean of each reading (default: 2s)"},
	{OPT_TIMEOUT, "timeout", "TIME",
	 "for a load to come and be steady (default: 1min)"},
	{OPT_GRAVITY, "gravity", "M_S2",
	 "local gravity (default: 9.80665, with the uncertainty of not\n"
	 "knowing where)"},
	{OPT_LATITUDE, "latitude", "DEG", "compute gravity for this place"},
	{OPT_ALTITUDE, "altitude", "M", "above the sea (default: 0)"},
	{OPT_SCALE, "scale", "MASS",
	 "resolution of the scale that weighed the loads (default: 0.5g)"},
	{OPT_DENSITY, "density", "KG_M3", "of the weights (default: 7950)"},
	{OPT_RANGE, "range", "LOW,HIGH",
	 "ends of the converter in mV (default: those of the rig,\n"
	 "or not known, with --from)"},
	{OPT_NOMINAL, "nominal", "MV_N", "to compare with (default: 1240)"},
	{OPT_TOLERANCE, "tolerance", "PERCENT", "of it, to pass (default: 5)"},
	{OPT_ZERO, "zero", NULL,
	 "put the zero in force as well; else it is measured at each\n"
	 "recording's start"},
	{0}};

static const struct cli_command command = {
	.name = "calibrate force",
	.synopsis = "[--weights LIST | --from FILE] [OPTIONS]",
	.summary =
		"Measure the sensitivity of the force channel with weights (procedure after "
		"ISO 376)\nand put it in force in calibration.conf.",
	.options = options,
	.notes =
		"Exit codes: 0 in force (or would be, --dry-run), 1 failed or refused, 2 bad "
		"usage.",
};

struct wish {
	struct calibrate_wish common;
	bool zero, ranged;
	double latitude_deg, altitude_m;
	const char *gravity; /* where it comes from */
	struct calibrate_weights weights;
	struct incise_calibrate_force_setup setup;
};

static void take_range(struct wish *wish, char *text)
{
	char *item[2];

	if (cli_list("range", text, item, 2) != 2)
		cli_usage("--range: expected two voltages in mV such as 0,5000");
	wish->setup.low_mV = cli_number("range", item[0], -1e6, 1e6);
	wish->setup.high_mV = cli_number("range", item[1], -1e6, 1e6);
	if (!(wish->setup.low_mV < wish->setup.high_mV))
		cli_usage("--range: the first is to be the lower one");
	wish->ranged = true;
}

static void take_options(struct wish *wish, int argc, char **argv)
{
	static const struct cli_unit grams[] = {{"g", 1}, {"mg", 1e-3}, {"kg", 1e3}, {0}};
	struct incise_calibrate_force_setup *setup = &wish->setup;
	int id;

	cli_negative_numbers(argc, argv);
	while ((id = cli_next(&command, argc, argv)) != CLI_END)
		switch (id) {
		case OPT_WEIGHTS:
			calibrate_weights_list(&wish->weights, optarg);
			break;
		case OPT_SERIES:
			wish->weights.series = (int)cli_integer("series", optarg, 1, 100);
			break;
		case OPT_TIME:
			wish->weights.mean_s = cli_duration("time", optarg, 0.1, 600);
			break;
		case OPT_TIMEOUT:
			wish->weights.timeout_s =
				cli_duration("timeout", optarg, 2, 3600);
			break;
		case OPT_GRAVITY:
			setup->gravity_m_s2 = cli_number("gravity", optarg, 9.7, 9.9);
			/* who knows it knows it to 10 mGal */
			setup->gravity_u_m_s2 = 1e-4;
			wish->gravity = "given, to 10 mGal";
			break;
		case OPT_LATITUDE:
			wish->latitude_deg = cli_number("latitude", optarg, -90, 90);
			break;
		case OPT_ALTITUDE:
			wish->altitude_m = cli_number("altitude", optarg, -1000, 10000);
			break;
		case OPT_SCALE:
			setup->scale_g = cli_quantity("--scale", optarg, grams, 0, 1e4);
			break;
		case OPT_DENSITY:
			setup->weight_kg_m3 = cli_number("density", optarg, 100, 25000);
			setup->weight_u_kg_m3 = 0.05 * setup->weight_kg_m3;
			break;
		case OPT_RANGE:
			take_range(wish, optarg);
			break;
		case OPT_NOMINAL:
			setup->nominal_mV_N = cli_number("nominal", optarg, 1, 1e5);
			break;
		case OPT_TOLERANCE:
			setup->tolerance =
				cli_number("tolerance", optarg, 0.001, 100) / 100;
			break;
		case OPT_ZERO:
			wish->zero = true;
			break;
		default:
			calibrate_option(&wish->common, id);
		}
	if (optind < argc)
		cli_usage("'%s' is too much: pairs are given with --from", argv[optind]);
	if (wish->common.from &&
	    (wish->common.rig || wish->weights.n || wish->common.keep))
		cli_usage("--from takes the place of a rig: leave --rig, --weights and "
			  "--keep out");
	if (!isnan(wish->latitude_deg) && wish->gravity)
		cli_usage("--gravity or --latitude: one of them");
}

/* Gravity of a place, and words for where it comes from. */
static void take_gravity(struct wish *wish)
{
	static char words[80];

	if (!isnan(wish->latitude_deg)) {
		wish->setup.gravity_m_s2 =
			incise_calibrate_gravity(wish->latitude_deg, wish->altitude_m);
		wish->setup.gravity_u_m_s2 = 5e-4;
		snprintf(words, sizeof(words), "WGS 84 at %g degrees, %g m",
			 wish->latitude_deg, wish->altitude_m);
		wish->gravity = words;
	} else if (!wish->gravity) {
		wish->gravity = "for anywhere on Earth (--latitude says where)";
	}
}

static void read_rig(struct wish *wish, struct calibrate_pairs *pairs, char *device,
		     size_t size)
{
	struct incise_error err = {0};
	struct incise_force_info info;
	const char *spec = cli_rig(wish->common.rig);

	if (!wish->weights.n) {
		if (!isatty(STDIN_FILENO))
			cli_usage("no terminal to ask for weights: give --weights or "
				  "--from");
		calibrate_weights_ask(&wish->weights);
	}
	wish->weights.rig = incise_rig_open(spec, INCISE_RIG_FORCE, &err);
	if (!wish->weights.rig)
		cli_fail_with(&err);
	incise_force_info(incise_rig_force(wish->weights.rig), &info);
	if (!wish->ranged) {
		wish->setup.low_mV = 1e3 * info.offset_V;
		wish->setup.high_mV = 1e3 * (info.offset_V + info.full_scale_V);
	}
	wish->setup.step_mV = 1e3 * info.full_scale_V / (double)(1LL << info.bits);
	wish->weights.setup = &wish->setup;
	snprintf(device, size, "%s", info.name);
	calibrate_weights_read(&wish->weights, pairs);
	incise_rig_close(wish->weights.rig);
	if (wish->common.keep)
		calibrate_pairs_write(pairs, wish->common.keep);
}

static void fill_record(const struct wish *wish,
			const struct incise_calibrate_force *result,
			struct incise_calibration_record *record)
{
	const struct incise_calibration *found = &wish->common.found;
	const double S = result->sensitivity_mV_N;
	const double off = 100 * (S / wish->setup.nominal_mV_N - 1);

	snprintf(record->kind, sizeof(record->kind), "force");
	calibrate_value(record, "force_mV_N", "mV/N", found->force_mV_N, S,
			result->sensitivity_u_mV_N);
	if (wish->zero)
		calibrate_value(record, "force_zero_mV", "mV", found->force_zero_mV,
				result->zero_mV, result->zero_u_mV);
	record->covariance[0] = pow(result->sensitivity_u_mV_N, 2);
	record->covariance[1] = result->covariance;
	record->covariance[2] = pow(result->zero_u_mV, 2);
	record->n_covariance = wish->zero ? 3 : 1;
	record->low = result->low_N;
	record->high = result->high_N;
	snprintf(record->range_unit, sizeof(record->range_unit), "N");
	record->pass = result->pass;
	snprintf(record->verdict, sizeof(record->verdict),
		 "%+.2f %% from the nominal %g mV/N, %s %g %%; U = %.2f mV/N (k = 2); "
		 "linearity %.2g %%",
		 off, wish->setup.nominal_mV_N, result->pass ? "within" : "more than",
		 100 * wish->setup.tolerance, 2 * result->sensitivity_u_mV_N,
		 result->linearity);
}

static void begin_record(const struct wish *wish, const char *device,
			 struct incise_calibration_record *record)
{
	const char *raw = wish->common.from ? wish->common.from : wish->common.keep;
	const time_t now = time(NULL);
	struct incise_error err = {0};
	struct tm utc;

	*record = (struct incise_calibration_record){.low = NAN, .high = NAN};
	strftime(record->date, sizeof(record->date), "%Y-%m-%dT%H:%M:%SZ",
		 gmtime_r(&now, &utc));
	snprintf(record->device, sizeof(record->device), "%s", device);
	snprintf(
		record->method, sizeof(record->method),
		"weights, procedure after ISO 376; weighted line, outliers by least median "
		"of squares");
	if (raw && incise_calibration_raw(record, raw, &err))
		cli_fail_with(&err);
}

int main(int argc, char **argv)
{
	struct wish wish = {.latitude_deg = NAN,
			    .weights = {.series = 3, .mean_s = 2, .timeout_s = 60}};
	struct incise_calibration_record record;
	struct calibrate_pairs pairs = {0};
	enum incise_calibrate_force_state *states;
	struct incise_calibrate_force result;
	struct calibrate_force_report report;
	struct incise_error err = {0};
	char device[64] = "";
	int rc;

	incise_calibrate_force_init(&wish.setup);
	take_options(&wish, argc, argv);
	take_gravity(&wish);
	cli_catch_signals();
	calibrate_find(&wish.common);
	if (wish.common.from)
		calibrate_pairs_read(&pairs, wish.common.from);
	else
		read_rig(&wish, &pairs, device, sizeof(device));
	begin_record(&wish, device, &record);
	states = calloc(pairs.n, sizeof(*states));
	if (!states)
		cli_fail("no memory");
	rc = incise_calibrate_force(pairs.pair, pairs.n, &wish.setup, &result, states,
				    &err);
	report = (struct calibrate_force_report){&pairs,
						 &wish.setup,
						 &result,
						 states,
						 &record,
						 rc ? err.text : NULL,
						 wish.common.found.force_mV_N,
						 wish.gravity};
	if (!rc)
		fill_record(&wish, &result, &record);
	if (wish.common.report)
		calibrate_force_write(&report, wish.common.report);
	if (wish.common.json)
		json_print(calibrate_force_json(&report));
	else if (!rc)
		calibrate_force_print(&report, false, stdout);
	cli_finish();
	if (rc)
		cli_fail("refused: %s; %s stays as it was", err.text,
			 wish.common.calibration);
	if (cli_stop)
		cli_fail("stopped; %s stays as it was", wish.common.calibration);
	if (!wish.common.dry_run &&
	    incise_calibration_append(wish.common.calibration, &record, &err))
		cli_fail_with(&err);
	if (!record.pass)
		cli_fail("not in force: %s", record.verdict);
	free(states);
	free(pairs.pair);
	return 0;
}
