// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate force: sensitivity of the force channel, from pairs of loads and readings:
 * measured with weights on a rig, or as CSV, which --from reads and -o FILE.csv writes.
 *
 *     mass_g,reading_mV,series,direction
 *     100,1395.2,1,up
 *
 * force_N may replace mass_g; series and direction (up, down) are optional.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_force.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "../../lib/base/ascending.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/uncertainty.h"
#include "calibrate.h"
#include "table.h"

#define WEIGHTS_MAX 100

/*
 * Weights, one after the other: asked for on a terminal, waited for without one, loaded by the
 * program on the virtual rig. Each is read when the reading is steady.
 *
 *     g      ___                ___
 *          _|   |             _|   |_      series up and back to zero; the last one
 *        _|     |_  …       _|       |_    comes down by the same loads
 */
struct weights {
	double mass_g[WEIGHTS_MAX];
	int n;
	int series;
	double mean_s;	  /* of a steady reading */
	double timeout_s; /* until it is steady */
};

struct force {
	struct calibrate common;
	bool zero, ranged;
	double latitude_deg, altitude_m; /* latitude_deg NAN: not given */
	const char *gravity;		 /* its source, for the report; NULL: not given */
	struct weights weights;
	struct incise_rig *rig;
	struct incise_calibrate_force_setup setup;
	struct incise_calibrate_force_pair *pairs;
	enum incise_calibrate_force_state *states; /* of pairs */
	int n;					   /* pairs */
	struct incise_calibrate_force result;
};

static const struct cli_unit masses[] = {{"g", 1}, {"kg", 1e3}, {"mg", 1e-3}, {0}};

/* "0,50g,0.1kg", by rising mass, with the empty pan; else bad usage. */
static void parse_weights(void *to, char *list)
{
	struct weights *weights = to;
	char *items[WEIGHTS_MAX];
	int n = cli_list("weights", list, items, WEIGHTS_MAX - 1);

	weights->n = 0;
	for (int i = 0; i < n; i++)
		weights->mass_g[weights->n++] =
			cli_quantity("--weights", items[i], masses, 0, 1e6);
	qsort(weights->mass_g, n, sizeof(*weights->mass_g), ascending);
	/* The empty pan is a load without error. */
	if (weights->mass_g[0] > 0) {
		memmove(weights->mass_g + 1, weights->mass_g,
			n * sizeof(*weights->mass_g));
		weights->mass_g[0] = 0;
		weights->n++;
	}
	for (int i = 1; i < weights->n; i++)
		if (weights->mass_g[i] == weights->mass_g[i - 1])
			cli_usage("--weights: %g g is listed twice; repeat all loads "
				  "with --repeat",
				  weights->mass_g[i]);
	if (weights->n < 3)
		cli_usage("--weights: expected the empty pan and 2 weights or more, for "
			  "example 0,50g,100g; 5 are recommended");
}

static void parse_gravity(void *run, char *text)
{
	static const struct cli_option keys[] = {
		{0, "gravity latitude", "DEG", NULL,
		 CLI_NUMBER(struct force, latitude_deg, -90, 90)},
		{0, "gravity altitude", "M", NULL,
		 CLI_NUMBER(struct force, altitude_m, -1000, 10000)},
		{0},
	};
	struct incise_calibrate_force_setup *setup = &((struct force *)run)->setup;

	if (strchr(text, '=')) {
		cli_keys(text, keys, run);
		if (isnan(((struct force *)run)->latitude_deg))
			cli_usage("--gravity: altitude needs latitude=DEG, too");
		return;
	}
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
	{'o', "output", "FILE.csv", "write the pairs as CSV, for --from",
	 CLI_OUTPUT(struct force, common.keep), .extensions = ".csv"},
	CALIBRATE_REPORT_OPTIONS(struct force),
	{0, "weights", "LIST",
	 "loads, for example 0,50g,100g,0.2kg (default: ask for them)",
	 CLI_PARSED(struct force, weights, parse_weights)},
	{0, "repeat", "N",
	 "series of all loads upwards; the last one also downwards (default: 3)",
	 CLI_INTEGER(struct force, weights.series, 1, 100)},
	{0, "duration", "TIME", "averaging time of each reading (default: 2s)",
	 CLI_DURATION(struct force, weights.mean_s, 0.1, 600)},
	{0, "timeout", "TIME",
	 "longest wait for a load to be put on and be steady (default: 1min)",
	 CLI_DURATION(struct force, weights.timeout_s, 2, 3600)},
	{0, "gravity", "M_S2|KEY=VALUE,...",
	 "local gravity, or where it is computed: latitude=DEG and altitude=M above "
	 "the sea (default: 9.80665, with the uncertainty of an unknown place)",
	 CLI_PARSED_BY(parse_gravity)},
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
		force->gravity =
			"for anywhere on Earth (--gravity latitude=DEG says where)";
	}
}

static void check_force_options(void *run, int argc, char **argv)
{
	struct force *force = run;
	const struct calibrate *common = &force->common;

	cli_no_operands(argc, argv, "--from");
	if (common->from && (common->rig || force->weights.n || common->keep))
		cli_usage("--from does not go with --rig, --weights or -o FILE.csv: it "
			  "takes the place of a rig");
	find_gravity(force);
	cli_catch_signals();
}

/* --- CSV ----------------------------------------------------------------------------- */

#define PAIRS_MAX 10000

enum { MASS, FORCE, READING, SERIES, DIRECTION };

static void add_pair(struct force *force, const struct incise_calibrate_force_pair *pair)
{
	if (force->n == PAIRS_MAX)
		cli_fail("more than %d pairs; give one average for each load", PAIRS_MAX);
	force->pairs = cli_grow(force->pairs, force->n, sizeof(*force->pairs));
	force->pairs[force->n++] = *pair;
}

static double parse_series(const struct table *table, const char *name, const char *text)
{
	double series = table_number(table, name, text);

	if (series != floor(series) || fabs(series) > 1e6)
		cli_fail("%s:%d: series: expected a whole number from -1000000 to "
			 "1000000; correct it",
			 table->path, table->line);
	return series;
}

/* 1: down. */
static double parse_direction(const struct table *table, const char *name,
			      const char *text)
{
	bool down = !strcmp(text, "down") || !strcmp(text, "descending");

	if (!down && strcmp(text, "up") && strcmp(text, "ascending"))
		cli_fail("%s:%d: %s: expected up or down, found '%s'; correct it",
			 table->path, table->line, name, text);
	return down;
}

static bool has_pair(const struct table *table)
{
	return table->at[READING] >= 0 && (table->at[MASS] < 0) != (table->at[FORCE] < 0);
}

static void add_force_row(void *run, const struct table *table, const double *row)
{
	const struct incise_calibrate_force_pair pair = {
		.mass_g = row[MASS],
		.force_N = row[FORCE],
		.reading_mV = row[READING],
		.series = table->at[SERIES] < 0 ? 0 : (int)row[SERIES],
		.descending = row[DIRECTION] > 0,
	};

	add_pair(run, &pair);
}

static void read_pairs(void *run, const char *path)
{
	static const struct table_form form = {
		"pairs",
		"reading_mV, and mass_g or force_N",
		"series and direction (up, down) are",
		{{"mass_g"},
		 {"force_N"},
		 {"reading_mV"},
		 {"series", parse_series},
		 {"direction", parse_direction}},
		has_pair,
	};

	table_read(path, &form, add_force_row, run);
}

static void write_pairs(const void *run, FILE *out)
{
	const struct force *force = run;
	bool masses = false;

	for (int i = 0; i < force->n; i++)
		masses |= !isnan(force->pairs[i].mass_g);
	fprintf(out, "%s,reading_mV,series,direction\n", masses ? "mass_g" : "force_N");
	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *pair = &force->pairs[i];

		fprintf(out, "%.10g,%.6f,%d,%s\n", masses ? pair->mass_g : pair->force_N,
			pair->reading_mV, pair->series, pair->descending ? "down" : "up");
	}
}

/* --- weights -------------------------------------------------------------------------- */

/* A reading is steady when it has neither moved nor swung for so long. */
#define STEADY_S 2
#define POLL_NS (INCISE_NS_PER_S / 20)
#define BLOCK 4096
/* More than this is a weight that swings, 20 codes of a converter. */
#define SWING_CODES 20

/* Mean and scatter of samples. */
struct mean {
	double mV, squares;
	long n, clipped;
};

static void ask_weights(struct weights *weights)
{
	char *line = NULL;
	size_t size = 0;

	fprintf(stderr, "Enter the loads that you can put on the pan, for example "
			"0,50g,100g,200g,300g: ");
	if (getline(&line, &size, stdin) < 0)
		cli_fail("stopped before a load was entered; nothing has changed");
	line[strcspn(line, "\n")] = 0;
	parse_weights(weights, line);
	free(line);
}

static void add_reading(struct mean *mean, double mV)
{
	double off = mV - mean->mV;

	mean->n++;
	mean->mV += off / mean->n;
	mean->squares += off * (mV - mean->mV);
}

static double sd_of(const struct mean *mean)
{
	return mean->n > 1 ? sqrt(mean->squares / (mean->n - 1)) : 0;
}

/* The samples of the next @s seconds. */
static struct mean read_mean(struct incise_rig *rig, double s)
{
	struct incise_force *force = incise_rig_force(rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_force_sample samples[BLOCK];
	struct incise_force_info info;
	struct mean mean = {0};
	int64_t end_ns;
	char cause[200];
	int n;

	incise_force_info(force, &info);
	/* drop the samples before */
	while (incise_force_read(force, samples, BLOCK) == BLOCK)
		;
	end_ns = incise_clock_now(clock) + (int64_t)(s * INCISE_NS_PER_S);
	while (!cli_stop && incise_clock_now(clock) < end_ns) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + POLL_NS);
		while ((n = incise_force_read(force, samples, BLOCK)) > 0)
			for (int i = 0; i < n; i++) {
				add_reading(&mean,
					    1e3 * (info.offset_V +
						   samples[i].code /
							   (double)(1LL << info.bits) *
							   info.full_scale_V));
				mean.clipped += samples[i].code <= 0 ||
						samples[i].code >= (1LL << info.bits) - 1;
			}
		if (n < 0) {
			incise_force_cause(force, cause, sizeof(cause));
			cli_fail("%s: the force channel failed: %s; nothing has changed",
				 incise_rig_spec(rig), *cause ? cause : strerror(-n));
		}
	}
	calibrate_check_stop();
	if (mean.n < 10)
		cli_fail(
			"%s: the force channel gave %ld samples in %g s; nothing has changed",
			incise_rig_spec(rig), mean.n, s);
	return mean;
}

/* Two halves of STEADY_S that agree, without a swing. */
static bool is_steady(const struct mean *a, const struct mean *b, double step_mV)
{
	double noise_mV = 4 * hypot(sd_of(a) / sqrt(a->n), sd_of(b) / sqrt(b->n));

	return fabs(a->mV - b->mV) <= fmax(step_mV, noise_mV) &&
	       fmax(sd_of(a), sd_of(b)) <= SWING_CODES * step_mV;
}

static bool is_terminal(void)
{
	return isatty(STDIN_FILENO) && isatty(STDERR_FILENO);
}

/*
 * Wait until a load is there and steady. @before_mV: the reading before it, or NAN; without a
 * terminal the load is there once the reading differs by half of @change_mV.
 */
static void wait_steady(struct force *force, double mass_g, double before_mV,
			double change_mV)
{
	const double step_mV = force->setup.step_mV;
	double waited_s = 0;
	struct mean last = read_mean(force->rig, STEADY_S / 2.0), now;

	for (;;) {
		bool there;

		now = read_mean(force->rig, STEADY_S / 2.0);
		waited_s += STEADY_S / 2.0;
		there = is_terminal() || isnan(before_mV) || now.clipped ||
			fabs(now.mV - before_mV) >= fabs(change_mV) / 2;
		cli_progress("%g g: %.1f mV, sd %.1f mV %s", mass_g, now.mV, sd_of(&now),
			     is_steady(&last, &now, step_mV) ? "" : "(not steady)");
		if (there && is_steady(&last, &now, step_mV))
			break;
		if (waited_s >= force->weights.timeout_s)
			cli_fail("%g g: %s within %g s: %.1f mV, sd %.1f mV; nothing has "
				 "changed",
				 mass_g,
				 there ? "the reading did not become steady"
				       : "the load was not put on",
				 force->weights.timeout_s, now.mV, sd_of(&now));
		last = now;
	}
}

/* Ask for a load; on the virtual rig apply it. */
static void request_load(struct force *force, double mass_g)
{
	struct incise_sim *sim = incise_rig_sim(force->rig);
	struct incise_calibrate_force_pair load = {.mass_g = mass_g};

	if (sim) {
		incise_sim_load(sim, incise_calibrate_force_of(&load, &force->setup));
		return;
	}
	cli_progress_end();
	if (mass_g > 0)
		fprintf(stderr, "Put a total of %g g on", mass_g);
	else
		fprintf(stderr, "Take all weights off");
	if (!is_terminal()) {
		fputc('\n', stderr);
		return;
	}
	fprintf(stderr, ", and press Enter: ");
	calibrate_await_enter();
}

/* Whether the reading is within the converter's range. */
static bool is_in_range(struct force *force,
			const struct incise_calibrate_force_pair *pair)
{
	return pair && pair->reading_mV > force->setup.low_mV &&
	       pair->reading_mV < force->setup.high_mV;
}

static void read_load(struct force *force, int series, bool descending, int k)
{
	const double mass_g = force->weights.mass_g[k];
	const struct incise_calibrate_force_pair *last =
		force->n ? &force->pairs[force->n - 1] : NULL;
	struct incise_calibrate_force_pair pair = {
		.mass_g = mass_g, .series = series, .descending = descending};
	double change_N = 0;
	struct mean mean;

	if (!last || last->mass_g != mass_g)
		request_load(force, mass_g);
	if (last)
		change_N = incise_calibrate_force_of(&pair, &force->setup) -
			   incise_calibrate_force_of(last, &force->setup);
	wait_steady(force, mass_g, last ? last->reading_mV : NAN,
		    is_in_range(force, last) ? change_N * force->setup.nominal_mV_N
					     : force->setup.step_mV);
	mean = read_mean(force->rig, force->weights.mean_s);
	pair.reading_mV = mean.mV;
	force->setup.dithered &= sd_of(&mean) >= force->setup.step_mV / 2;
	/* Clipped noise shifts the mean: the reading counts as saturated, and is left out. */
	if (mean.clipped > mean.n / 1000)
		pair.reading_mV =
			mean.mV < (force->setup.low_mV + force->setup.high_mV) / 2
				? force->setup.low_mV
				: force->setup.high_mV;
	add_pair(force, &pair);
	cli_progress_end();
	fprintf(stderr, "%d%s %8g g %10.2f mV  sd %.2f mV\n", series,
		descending ? " down" : "   up", mass_g, mean.mV, sd_of(&mean));
}

static void measure_series(struct force *force)
{
	const int top = force->weights.n - 1, last = force->weights.series;

	force->setup.dithered = true;
	for (int series = 1; series <= last; series++) {
		for (int k = 0; k <= top; k++)
			read_load(force, series, false, k);
		/* The last comes down by all loads, the others at once. */
		for (int k = series == last ? top - 1 : 0; k >= 0; k--)
			read_load(force, series, true, k);
	}
}

static void measure_loads(void *run)
{
	struct force *force = run;
	struct incise_force_info info;

	if (!force->weights.n) {
		if (!isatty(STDIN_FILENO))
			cli_usage("missing --weights or --from (needed without a "
				  "terminal to ask for weights)");
		ask_weights(&force->weights);
	}
	force->rig = cli_open_rig(force->common.rig, INCISE_RIG_FORCE);
	incise_force_info(incise_rig_force(force->rig), &info);
	if (info.newtons)
		cli_fail(
			"%s measures newtons itself: no mV/N applies to it; calibrate it "
			"with its own program",
			info.name);
	if (!force->ranged) {
		force->setup.low_mV = 1e3 * info.offset_V;
		force->setup.high_mV = 1e3 * (info.offset_V + info.full_scale_V);
	}
	force->setup.step_mV = 1e3 * info.full_scale_V / (double)(1LL << info.bits);
	calibrate_words(force->common.record.device, "%s", info.name);
	measure_series(force);
	incise_rig_close(force->rig);
}

/* --- the fit ------------------------------------------------------------------------- */

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

/* --- the report ---------------------------------------------------------------------- */

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

static void print_metrics(const struct force *force, FILE *out)
{
	const struct incise_calibrate_force *r = &force->result;
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

static void print_budget(const struct force *force, FILE *out)
{
	const struct incise_calibrate_force *r = &force->result;
	const struct incise_calibrate_force_setup *s = &force->setup;

	fprintf(out,
		"\n"
		"Uncertainty budget of the sensitivity (standard uncertainties)\n"
		"\n"
		"%-28s %-4s %-18s %-20s %s\n",
		"source", "type", "u", "sensitivity", "u, mV/N");
	for (int i = 0; i < r->budget.n; i++) {
		const struct incise_calibration_part *part = &r->budget.part[i];
		char u[24], c[32];

		snprintf(u, sizeof(u), "%.3g %s", part->u, part->unit);
		snprintf(c, sizeof(c), "%.3g mV/N per %s", part->sensitivity, part->unit);
		fprintf(out, "%-28s %-4c %-18s %-20s %.4f\n", part->source, part->type, u,
			c, part->contribution);
	}
	fprintf(out, "%-28s %-4s %-18s %-20s %.4f\n\n", "root sum of squares", "", "", "",
		r->sensitivity_u_mV_N);
	fprintf(out,
		"Type A has %d degrees of freedom, and is widened so that k = 2 covers "
		"95 %%.\n"
		"Gravity %.5f m/s2, u = %.2g, %s. Air %.3g kg/m3, weights %.5g kg/m3.\n"
		"The scale resolves %.3g g: rectangular distribution, one error for "
		"each load weighed.\n",
		r->freedom, s->gravity_m_s2, s->gravity_u_m_s2, force->gravity,
		s->air_kg_m3, s->weight_kg_m3, s->scale_g);
}

static double residual_mV(const struct force *force, int i)
{
	return force->pairs[i].reading_mV - force->result.zero_mV -
	       force->result.sensitivity_mV_N *
		       incise_calibrate_force_of(&force->pairs[i], &force->setup);
}

/* All pairs, or those that were left out. */
static void print_pairs(const struct force *force, bool all, FILE *out)
{
	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];

		if (!all && force->states[i] == INCISE_CALIBRATE_FORCE_USED)
			continue;
		fprintf(out, "pair %-4d %10.5f N %10.2f mV  series %d %-4s  %s", i + 1,
			incise_calibrate_force_of(p, &force->setup), p->reading_mV,
			p->series, p->descending ? "down" : "up",
			states[force->states[i]]);
		if (!force->common.refused)
			fprintf(out, ", %+.2f mV off", residual_mV(force, i));
		fputc('\n', out);
	}
}

static void print_summary(const void *run, FILE *out)
{
	print_metrics(run, out);
	print_pairs(run, false, out);
}

static void print_force_report(const void *run, FILE *out)
{
	const struct force *force = run;
	const struct incise_calibration_record *record = &force->common.record;

	fprintf(out, "Calibration of a force channel, %s\n%s\n%s\n\n", record->date,
		record->device, record->method);
	if (force->common.refused) {
		fprintf(out, "refused: %s\n", force->common.refused);
	} else {
		print_metrics(force, out);
		print_budget(force, out);
	}
	fputc('\n', out);
	print_pairs(force, true, out);
}

static json_t *json_pairs(const struct force *force)
{
	json_t *list = json_array();

	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];

		json_array_append_new(
			list, json_pack("{s:o, s:o, s:i, s:b, s:s}", "force_N",
					json_number(incise_calibrate_force_of(
						p, &force->setup)),
					"reading_mV", json_number(p->reading_mV),
					"series", p->series, "descending", p->descending,
					"state", states[force->states[i]]));
	}
	return list;
}

static json_t *make_force_json(const void *run)
{
	const struct force *force = run;
	const struct incise_calibrate_force *r = &force->result;
	const struct incise_calibration_record *record = &force->common.record;
	json_t *root = json_pack("{s:s, s:o, s:o, s:o, s:o}", "kind", record->kind,
				 "date", json_text(record->date), "device",
				 json_text(record->device), "method",
				 json_text(record->method), "pairs", json_pairs(force));

	if (force->common.refused) {
		json_object_set_new(root, "refused", json_text(force->common.refused));
		json_object_set_new(root, "pass", json_false());
		return root;
	}
	json_set_number(root, "found_mV_N", force->common.found.force_mV_N);
	json_set_number(root, "sensitivity_mV_N", r->sensitivity_mV_N);
	json_set_number(root, "sensitivity_u_mV_N", r->sensitivity_u_mV_N);
	json_set_number(root, "sensitivity_U_mV_N", 2 * r->sensitivity_u_mV_N);
	json_set_number(root, "zero_mV", r->zero_mV);
	json_set_number(root, "zero_u_mV", r->zero_u_mV);
	json_set_number(root, "residual_sd_mV", r->residual_sd_mV);
	json_set_number(root, "scatter_sd_mV", r->scatter_sd_mV);
	json_set_number(root, "misfit", r->misfit);
	json_object_set_new(root, "budget", calibrate_budget(&r->budget, true, "u_mV_N"));
	json_set_number(root, "linearity_percent", r->linearity);
	json_set_number(root, "hysteresis_percent", r->hysteresis);
	json_set_number(root, "repeatability_percent", r->repeatability);
	json_set_number(root, "zero_return_percent", r->zero_return);
	json_set_number(root, "resolution_N", r->resolution_N);
	json_set_number(root, "low_N", r->low_N);
	json_set_number(root, "high_N", r->high_N);
	json_set_number(root, "clips_N", r->clips_N);
	json_set_integer(root, "used", r->used);
	json_set_integer(root, "saturated", r->saturated);
	json_set_integer(root, "outliers", r->outliers);
	json_set_integer(root, "loads", r->loads);
	json_set_integer(root, "series", r->series);
	json_object_set_new(root, "pass", json_boolean(r->pass));
	json_object_set_new(root, "verdict", json_text(record->verdict));
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
static void draw_force_plots(const void *run, const char *folder)
{
	const struct force *force = run;
	const struct incise_calibrate_force *r = &force->result;
	FILE *data = plot_data(folder, "pairs.dat"), *script;
	bool there[3] = {false};

	for (int i = 0; i < force->n; i++) {
		const struct incise_calibrate_force_pair *p = &force->pairs[i];
		int kind = force->states[i] ? 2 : p->descending ? 1 : 0;

		there[kind] = true;
		fprintf(data, "%.6f %.4f %.4f %d\n",
			incise_calibrate_force_of(p, &force->setup), p->reading_mV,
			residual_mV(force, i), kind);
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
	calibrate_draw(script, folder, "fit");
	script = plot_begin(folder, "residuals", 900, 560);
	fputs("set title 'Residuals of the reading from the line'\n"
	      "set xlabel 'force / N'\nset ylabel 'residual of the reading / mV'\n"
	      "eval key_below\n",
	      script);
	there[2] = false;
	put_pairs(script, 3, there);
	fputs(", \\\n  0 with lines lc rgb ink lw 1\n", script);
	calibrate_draw(script, folder, "residuals");
}

int calibrate_force(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "force",
		.command = &command,
		.check = check_force_options,
		.read = read_pairs,
		.measure = measure_loads,
		.write = write_pairs,
		.fit = fit_force,
		.reports_refusal = true,
		.text = print_force_report,
		.summary = print_summary,
		.json = make_force_json,
		.draw = draw_force_plots,
	};
	static struct force force = {
		.latitude_deg = NAN,
		.weights = {.series = 3, .mean_s = 2, .timeout_s = 60},
	};

	cli_negative_numbers(argc, argv);
	incise_calibrate_force_init(&force.setup);
	return calibrate_run(&kind, argc, argv, &force);
}
