// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate force: sensitivity of the force channel, from weights.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include "calibrate/calibrate.h"
#include "calibrate/force.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/uncertainty.h"

struct options {
	struct calibrate_options common;
	bool zero, ranged;
	double latitude_deg, altitude_m; /* latitude_deg NAN: not given */
	const char *gravity;		 /* its source, for the report */
	struct weights weights;
	struct incise_calibrate_force_setup setup;
};

static void parse_gravity(void *options, char *text)
{
	struct incise_calibrate_force_setup *setup = &((struct options *)options)->setup;

	setup->gravity_m_s2 = cli_number("gravity", text, 9.7, 9.9);
	setup->gravity_u_m_s2 = 1e-4; /* 10 mGal */
	((struct options *)options)->gravity = "given, to 10 mGal";
}

static void parse_density(void *options, char *text)
{
	struct incise_calibrate_force_setup *setup = &((struct options *)options)->setup;

	setup->weight_kg_m3 = cli_number("density", text, 100, 25000);
	setup->weight_u_kg_m3 = 0.05 * setup->weight_kg_m3;
}

static void parse_tolerance(void *tolerance, char *text)
{
	*(double *)tolerance = cli_number("tolerance", text, 0.001, 100) / 100;
}

static void parse_range(void *whole, char *text)
{
	struct options *options = whole;
	char *item[2];

	if (cli_list("input-range", text, item, 2) != 2)
		cli_usage("--input-range: expected two voltages in mV, the lower one "
			  "first, for example 0,5000");
	options->setup.low_mV = cli_number("input-range", item[0], -1e6, 1e6);
	options->setup.high_mV = cli_number("input-range", item[1], -1e6, 1e6);
	if (!(options->setup.low_mV < options->setup.high_mV))
		cli_usage("--input-range: expected the lower voltage first, for "
			  "example 0,5000");
	options->ranged = true;
}

static void parse_weights(void *weights, char *text)
{
	weights_parse(weights, text);
}

static const struct cli_unit grams[] = {{"g", 1}, {"mg", 1e-3}, {"kg", 1e3}, {0}};

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct options, common.rig)},
	{CALIBRATE_FILE_OPTION(struct options)},
	{0, "from", "FILE",
	 "pairs instead of a rig: CSV with mass_g or force_N, reading_mV, and "
	 "optionally series and direction (up, down)",
	 CLI_INPUT(struct options, common.from)},
	{0, "keep", "FILE", "write the pairs to this file, for --from",
	 CLI_OUTPUT(struct options, common.keep), .extensions = ".csv"},
	{0, "report", "DIR", "write report.txt, report.json and plots into this folder",
	 CLI_OUTPUTS(struct options, common.report)},
	{0, "dry-run", NULL, "do everything except writing calibration.conf",
	 CLI_FLAG(struct options, common.dry_run)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, common.json)},
	{0, "weights", "LIST",
	 "loads, for example 0,50g,100g,0.2kg (default: ask for them)",
	 CLI_PARSED(struct options, weights, parse_weights)},
	{0, "series", "N",
	 "series of all loads upwards; the last one also downwards (default: 3)",
	 CLI_INTEGER(struct options, weights.series, 1, 100)},
	{0, "duration", "TIME", "averaging time of each reading (default: 2s)",
	 CLI_DURATION(struct options, weights.mean_s, 0.1, 600)},
	{0, "timeout", "TIME",
	 "longest wait for a load to be put on and be steady (default: 1min)",
	 CLI_DURATION(struct options, weights.timeout_s, 2, 3600)},
	{0, "gravity", "M_S2",
	 "local gravity (default: 9.80665, with the uncertainty of an unknown "
	 "place)",
	 CLI_PARSED_BY(parse_gravity)},
	{0, "latitude", "DEG", "latitude, to compute gravity from",
	 CLI_NUMBER(struct options, latitude_deg, -90, 90)},
	{0, "altitude", "M",
	 "altitude above the sea, to compute gravity from (default: 0)",
	 CLI_NUMBER(struct options, altitude_m, -1000, 10000)},
	{0, "scale", "MASS",
	 "resolution of the scale that weighed the loads (default: 0.5g)",
	 CLI_QUANTITY(struct options, setup.scale_g, grams, 0, 1e4)},
	{0, "density", "KG_M3", "density of the weights (default: 7950)",
	 CLI_PARSED_BY(parse_density)},
	{0, "input-range", "LOW,HIGH",
	 "range of the converter in mV (default: that of the rig; unknown with "
	 "--from)",
	 CLI_PARSED_BY(parse_range)},
	{0, "nominal", "MV_N", "nominal sensitivity to compare with (default: 1240)",
	 CLI_NUMBER(struct options, setup.nominal_mV_N, 1, 1e5)},
	{0, "tolerance", "PERCENT", "largest deviation from it that passes (default: 5)",
	 CLI_PARSED(struct options, setup.tolerance, parse_tolerance)},
	{0, "zero", NULL,
	 "also calibrate the zero (default: measured at the start of each "
	 "recording)",
	 CLI_FLAG(struct options, zero)},
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

static void parse(struct options *options, int argc, char **argv)
{
	const struct calibrate_options *common = &options->common;

	cli_negative_numbers(argc, argv);
	cli_parse(&command, argc, argv, options);
	cli_no_operands(argc, argv, "--from");
	if (common->from && (common->rig || options->weights.n || common->keep))
		cli_usage("--from does not go with --rig, --weights or --keep: it "
			  "takes the place of a rig");
	if (!isnan(options->latitude_deg) && options->gravity)
		cli_usage("--gravity and --latitude exclude each other; give one of "
			  "them");
}

/* Gravity of the place, and its source for the report. */
static void find_gravity(struct options *options)
{
	static char words[80];

	if (!isnan(options->latitude_deg)) {
		options->setup.gravity_m_s2 = incise_calibrate_gravity(
			options->latitude_deg, options->altitude_m);
		options->setup.gravity_u_m_s2 = 5e-4;
		snprintf(words, sizeof(words), "WGS 84 at %g degrees, %g m",
			 options->latitude_deg, options->altitude_m);
		options->gravity = words;
	} else if (!options->gravity) {
		options->gravity = "for anywhere on Earth (--latitude says where)";
	}
}

static void read_rig(struct options *options, struct pairs *pairs, char *device,
		     size_t size)
{
	const char *spec = cli_rig(options->common.rig);
	struct incise_force_info info;

	if (!options->weights.n) {
		if (!isatty(STDIN_FILENO))
			cli_usage("missing --weights or --from (needed without a "
				  "terminal to ask for weights)");
		weights_ask(&options->weights);
	}
	options->weights.rig = cli_open_rig(spec, INCISE_RIG_FORCE);
	incise_force_info(incise_rig_force(options->weights.rig), &info);
	if (info.newtons)
		cli_fail(
			"%s measures newtons itself: no mV/N applies to it; calibrate it "
			"with its own program",
			info.name);
	if (!options->ranged) {
		options->setup.low_mV = 1e3 * info.offset_V;
		options->setup.high_mV = 1e3 * (info.offset_V + info.full_scale_V);
	}
	options->setup.step_mV = 1e3 * info.full_scale_V / (double)(1LL << info.bits);
	options->weights.setup = &options->setup;
	snprintf(device, size, "%s", info.name);
	weights_measure(&options->weights, pairs);
	incise_rig_close(options->weights.rig);
	if (options->common.keep)
		pairs_write(pairs, options->common.keep);
}

static void fill_record(const struct options *options,
			const struct incise_calibrate_force *result,
			struct incise_calibration_record *record)
{
	const struct incise_calibration *found = &options->common.found;
	const double S = result->sensitivity_mV_N;
	const double off = 100 * (S / options->setup.nominal_mV_N - 1);

	snprintf(record->kind, sizeof(record->kind), "force");
	calibrate_value(record, "force_mV_N", "mV/N", found->force_mV_N, S,
			result->sensitivity_u_mV_N);
	if (options->zero)
		calibrate_value(record, "force_zero_mV", "mV", found->force_zero_mV,
				result->zero_mV, result->zero_u_mV);
	record->covariance[0] = pow(result->sensitivity_u_mV_N, 2);
	record->covariance[1] = result->covariance;
	record->covariance[2] = pow(result->zero_u_mV, 2);
	record->n_covariance = options->zero ? 3 : 1;
	record->low = result->low_N;
	record->high = result->high_N;
	snprintf(record->range_unit, sizeof(record->range_unit), "N");
	record->pass = result->pass;
	snprintf(record->verdict, sizeof(record->verdict),
		 "%+.2f %% from the nominal %g mV/N, %s %g %%; U = %.2f mV/N (k = 2); "
		 "linearity %.2g %%",
		 off, options->setup.nominal_mV_N, result->pass ? "within" : "more than",
		 100 * options->setup.tolerance, 2 * result->sensitivity_u_mV_N,
		 result->linearity);
}

static void begin_record(const struct options *options, const char *device,
			 struct incise_calibration_record *record)
{
	const char *raw =
		options->common.from ? options->common.from : options->common.keep;
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

/* --- the report ------------------------------------------------------------------------ */

struct report {
	const struct pairs *pairs;
	const struct incise_calibrate_force_setup *setup;
	const struct incise_calibrate_force *result;
	const enum incise_calibrate_force_state *states;
	const struct incise_calibration_record *record;
	const char *refused; /* why there is no result; NULL: there is one */
	const struct calibrate_options *common;
	const char *gravity; /* its source */
};

static const char *const states[] = {
	[INCISE_CALIBRATE_FORCE_USED] = "used",
	[INCISE_CALIBRATE_FORCE_SATURATED] = "saturated",
	[INCISE_CALIBRATE_FORCE_OUTLIER] = "outlier",
};

static void print_metric(FILE *out, const char *name, double value, const char *unit)
{
	if (isnan(value))
		fprintf(out, "%-15s not stated\n", name);
	else
		fprintf(out, "%-15s %.3g %s\n", name, value, unit);
}

static void print_metrics(const struct report *report, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;
	char text[UNCERTAINTY_TEXT];

	fprintf(out, "%-15s %s (k = 2), %.2g %%\n", "sensitivity",
		uncertainty_text(r->sensitivity_mV_N, 2 * r->sensitivity_u_mV_N, "mV/N",
				 text),
		200 * r->sensitivity_u_mV_N / r->sensitivity_mV_N);
	fprintf(out, "%-15s %s (k = 2)\n", "zero",
		uncertainty_text(r->zero_mV, 2 * r->zero_u_mV, "mV", text));
	fprintf(out, "%-15s %.3g mV, scatter of one load %.3g mV\n", "residual sd",
		r->residual_sd_mV, r->scatter_sd_mV);
	print_metric(out, "linearity", r->linearity,
		     "% of full scale, best straight line");
	print_metric(out, "hysteresis", r->hysteresis, "% of full scale");
	print_metric(out, "repeatability", r->repeatability, "% of full scale");
	print_metric(out, "zero return", r->zero_return, "% of full scale");
	print_metric(out, "resolution", 1e3 * r->resolution_N, "mN");
	fprintf(out, "%-15s %.3g N to %.4g N", "range", r->low_N, r->high_N);
	if (isnan(r->clips_N))
		fprintf(out, "\n");
	else
		fprintf(out, "; the converter ends at %.4g N\n", r->clips_N);
	fprintf(out, "%-15s %d of %d used, %s, %d series; %d saturated, %s\n", "pairs",
		r->used, r->pairs, cli_count(r->loads, "load"), r->series, r->saturated,
		cli_count(r->outliers, "outlier"));
	if (r->misfit > 1)
		fprintf(out,
			"%-15s loads deviate from a line by %.1f times their "
			"uncertainty; U is widened by this factor\n",
			"misfit", r->misfit);
}

static void print_budget(const struct report *report, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;
	const struct incise_calibrate_force_setup *s = report->setup;

	fprintf(out,
		"\n"
		"Uncertainty budget of the sensitivity (standard uncertainties)\n"
		"\n"
		"%-28s %-4s %-18s %-20s %s\n",
		"source", "type", "u", "sensitivity", "u, mV/N");
	for (int i = 0; i < r->parts; i++) {
		const struct incise_calibrate_force_part *part = &r->part[i];
		char u[24], c[32];

		snprintf(u, sizeof(u), "%.3g %s", part->u, part->unit);
		snprintf(c, sizeof(c), "%.3g mV/N per %s", part->sensitivity, part->unit);
		fprintf(out, "%-28s %-4c %-18s %-20s %.4f\n", part->source, part->type, u,
			c, part->u_mV_N);
	}
	fprintf(out, "%-28s %-4s %-18s %-20s %.4f\n\n", "root sum of squares", "", "", "",
		r->sensitivity_u_mV_N);
	fprintf(out,
		"Type A has %d degrees of freedom, and is widened so that k = 2 covers "
		"95 %%.\n"
		"Gravity %.5f m/s2, u = %.2g, %s. Air %.3g kg/m3, weights %.5g kg/m3.\n"
		"The scale resolves %.3g g: rectangular distribution, one error for "
		"each load weighed.\n",
		r->freedom, s->gravity_m_s2, s->gravity_u_m_s2, report->gravity,
		s->air_kg_m3, s->weight_kg_m3, s->scale_g);
}

/* All pairs, or those that were left out. */
static void print_pairs(const struct report *report, bool all, FILE *out)
{
	const struct incise_calibrate_force *r = report->result;

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];
		double F_N = incise_calibrate_force_of(p, report->setup);

		if (!all && report->states[i] == INCISE_CALIBRATE_FORCE_USED)
			continue;
		fprintf(out, "pair %-4d %10.5f N %10.2f mV  series %d %-4s  %s", i + 1,
			F_N, p->reading_mV, p->series, p->descending ? "down" : "up",
			states[report->states[i]]);
		if (!report->refused)
			fprintf(out, ", %+.2f mV off",
				p->reading_mV - r->zero_mV - r->sensitivity_mV_N * F_N);
		fputc('\n', out);
	}
}

/* As text: with budget and pairs if @all. */
static void print_report(const struct report *report, bool all, FILE *out)
{
	if (all)
		fprintf(out, "Calibration of a force channel, %s\n%s\n%s\n\n",
			report->record->date, report->record->device,
			report->record->method);
	if (report->refused)
		fprintf(out, "refused: %s\n", report->refused);
	else
		print_metrics(report, out);
	if (all && !report->refused)
		print_budget(report, out);
	if (all)
		fputc('\n', out);
	print_pairs(report, all, out);
	if (!report->refused && all)
		calibrate_result_text(report->common, report->record, out);
}

static json_t *json_budget(const struct incise_calibrate_force *r)
{
	json_t *list = json_array();

	for (int i = 0; i < r->parts; i++) {
		const struct incise_calibrate_force_part *part = &r->part[i];
		const char type[2] = {part->type};

		json_array_append_new(
			list, json_pack("{s:o, s:s, s:o, s:s, s:o, s:o}", "source",
					json_text(part->source), "type", type, "u",
					json_number(part->u), "unit", part->unit,
					"sensitivity", json_number(part->sensitivity),
					"u_mV_N", json_number(part->u_mV_N)));
	}
	return list;
}

static json_t *report_json(const struct report *report)
{
	const struct incise_calibrate_force *r = report->result;
	json_t *pairs = json_array(), *root;

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];

		json_array_append_new(
			pairs, json_pack("{s:o, s:o, s:i, s:b, s:s}", "force_N",
					 json_number(incise_calibrate_force_of(
						 p, report->setup)),
					 "reading_mV", json_number(p->reading_mV),
					 "series", p->series, "descending", p->descending,
					 "state", states[report->states[i]]));
	}
	root = json_pack("{s:s, s:o, s:o, s:o, s:o}", "kind", "force", "date",
			 json_text(report->record->date), "device",
			 json_text(report->record->device), "method",
			 json_text(report->record->method), "pairs", pairs);
	if (report->refused) {
		json_object_set_new(root, "refused", json_text(report->refused));
		json_object_set_new(root, "pass", json_false());
		return root;
	}
	json_object_update_new(
		root,
		json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
			  "found_mV_N", json_number(report->common->found.force_mV_N),
			  "sensitivity_mV_N", json_number(r->sensitivity_mV_N),
			  "sensitivity_u_mV_N", json_number(r->sensitivity_u_mV_N),
			  "sensitivity_U_mV_N", json_number(2 * r->sensitivity_u_mV_N),
			  "zero_mV", json_number(r->zero_mV), "zero_u_mV",
			  json_number(r->zero_u_mV), "residual_sd_mV",
			  json_number(r->residual_sd_mV), "scatter_sd_mV",
			  json_number(r->scatter_sd_mV), "misfit", json_number(r->misfit),
			  "budget", json_budget(r)));
	json_object_update_new(
		root, json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
				"linearity_percent", json_number(r->linearity),
				"hysteresis_percent", json_number(r->hysteresis),
				"repeatability_percent", json_number(r->repeatability),
				"zero_return_percent", json_number(r->zero_return),
				"resolution_N", json_number(r->resolution_N), "low_N",
				json_number(r->low_N), "high_N", json_number(r->high_N),
				"clips_N", json_number(r->clips_N)));
	json_object_update_new(
		root, json_pack("{s:i, s:i, s:i, s:i, s:i, s:b, s:o}", "used", r->used,
				"saturated", r->saturated, "outliers", r->outliers,
				"loads", r->loads, "series", r->series, "pass", r->pass,
				"verdict", json_text(report->record->verdict)));
	return root;
}

/* The pairs by rising, falling and left out, those that are there, as a plot of a column. */
static void put_pairs(FILE *script, int column, const bool there[3])
{
	static const char *const names[] = {"rising", "falling", "left out"};
	static const int markers[] = {9, 11, 2};
	int n = 0;

	for (int k = 0; k < 3; k++)
		if (there[k])
			plot_add(
				script, &n,
				"'pairs.dat' using ($4 == %d ? $1 : NaN):%d with points lt %d "
				"pt %d ps 1 title '%s'",
				k, column, k + 1, markers[k], names[k]);
}

/* Both plots use one file: force, reading, residual, and whether it was used. */
static void draw(const struct report *report, const char *folder)
{
	const struct incise_calibrate_force *r = report->result;
	FILE *data = plot_data(folder, "pairs.dat"), *script;
	bool there[3] = {false};

	for (int i = 0; i < report->pairs->n; i++) {
		const struct incise_calibrate_force_pair *p = &report->pairs->pair[i];
		double F_N = incise_calibrate_force_of(p, report->setup);

		int kind = report->states[i] ? 2 : p->descending ? 1 : 0;

		there[kind] = true;
		fprintf(data, "%.6f %.4f %.4f %d\n", F_N, p->reading_mV,
			p->reading_mV - r->zero_mV - r->sensitivity_mV_N * F_N, kind);
	}
	plot_data_end(data, folder);
	script = plot_begin(folder, "fit", 900, 560);
	fputs("set title 'Reading of the force channel over the applied force'\n"
	      "set xlabel 'force / N'\nset ylabel 'reading / mV'\neval key_below\n",
	      script);
	put_pairs(script, 2, there);
	fprintf(script,
		", \\\n  %.10g + %.10g * x with lines lc rgb ink lw 1 title 'line, %.2f mV/N'\n",
		r->zero_mV, r->sensitivity_mV_N, r->sensitivity_mV_N);
	plot_draw_or_fail(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the reading from the line'\n"
	      "set xlabel 'force / N'\nset ylabel 'residual of the reading / mV'\n"
	      "eval key_below\n",
	      script);
	there[2] = false;
	put_pairs(script, 3, there);
	fputs(", \\\n  0 with lines lc rgb ink lw 1\n", script);
	plot_draw_or_fail(script, folder, "residuals");
}

/* DIR/report.txt, report.json, fit.png and residuals.png. */
static void write_report(const struct report *report, const char *folder)
{
	struct incise_outfile *file;
	FILE *out;

	if (plot_possible()) {
		plot_folder(folder);
		if (!report->refused)
			draw(report, folder);
	} else {
		cli_warn("gnuplot is not installed, so the report has no plots; "
			 "apt-get install gnuplot-nox");
		if (mkdir(folder, 0777) && errno != EEXIST)
			cli_fail("%s: %s", folder, strerror(errno));
	}
	out = calibrate_report_text(folder, &file);
	print_report(report, true, out);
	whole_file_end(file);
	calibrate_report_json(folder, report_json(report));
}

int main(int argc, char **argv)
{
	struct options options = {.latitude_deg = NAN,
				  .weights = {.series = 3, .mean_s = 2, .timeout_s = 60}};
	struct incise_calibration_record record;
	struct pairs pairs = {0};
	enum incise_calibrate_force_state *states;
	struct incise_calibrate_force result;
	struct report report;
	struct incise_error err = {0};
	char device[64] = "";
	int rc;

	incise_calibrate_force_init(&options.setup);
	parse(&options, argc, argv);
	find_gravity(&options);
	cli_catch_signals();
	calibrate_find(&options.common);
	if (options.common.from)
		pairs_read(&pairs, options.common.from);
	else
		read_rig(&options, &pairs, device, sizeof(device));
	begin_record(&options, device, &record);
	states = cli_alloc(pairs.n, sizeof(*states));
	rc = incise_calibrate_force(pairs.pair, pairs.n, &options.setup, &result, states,
				    &err);
	report = (struct report){&pairs,	  &options.setup, &result,
				 states,	  &record,	  rc ? err.text : NULL,
				 &options.common, options.gravity};
	if (!rc)
		fill_record(&options, &result, &record);
	if (options.common.report)
		write_report(&report, options.common.report);
	if (!rc)
		calibrate_append(&options.common, &record);
	if (options.common.json) {
		json_print(report_json(&report));
	} else if (!rc) {
		print_report(&report, false, stdout);
		calibrate_result(&options.common, &record);
	}
	if (rc)
		cli_fail("refused: %s; %s stays as it was", err.text,
			 options.common.calibration);
	calibrate_require_pass(&record);
	free(states);
	free(pairs.pair);
	return 0;
}
