// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pairs of loads and readings; see force.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/sim.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "calibrate.h"
#include "force.h"

/* --- CSV ----------------------------------------------------------------------------- */

#define PAIRS_MAX 10000
#define COLUMNS_MAX 32

enum { MASS, FORCE, READING, SERIES, DIRECTION, COLUMNS };
static const char *const names[COLUMNS] = {"mass_g", "force_N", "reading_mV", "series",
					   "direction"};

struct table {
	const char *path;
	int line;
	int column[COLUMNS]; /* index of each; -1: none */
};

static void add_pair(struct pairs *pairs, const struct incise_calibrate_force_pair *pair)
{
	if (pairs->n == PAIRS_MAX)
		cli_fail("more than %d pairs; give one average for each load", PAIRS_MAX);
	/* grown in steps: 64, 128, … */
	if (!(pairs->n & (pairs->n - 1)) && (pairs->n >= 64 || !pairs->n))
		pairs->pair = cli_resize(pairs->pair, pairs->n ? 2 * pairs->n : 64,
					 sizeof(*pairs->pair));
	pairs->pair[pairs->n++] = *pair;
}

static void read_header(struct table *table, char **fields, int n)
{
	for (int c = 0; c < COLUMNS; c++) {
		table->column[c] =
			calibrate_column(table->path, table->line, fields, n, names[c]);
	}
	if (table->column[READING] < 0 ||
	    (table->column[MASS] < 0) == (table->column[FORCE] < 0))
		cli_fail(
			"%s:%d: expected a line of column names: reading_mV, and mass_g or "
			"force_N; series and direction (up, down) are optional",
			table->path, table->line);
}

static double number_of(const struct table *table, int column, char **fields)
{
	const char *text = fields[table->column[column]];
	char *end;
	double value = incise_decimal(text, &end);

	if (end == text || *end || !isfinite(value))
		cli_fail("%s:%d: %s: expected a number, found '%s'; correct it",
			 table->path, table->line, names[column], text);
	return value;
}

static bool descends(const struct table *table, char **fields)
{
	const char *text = fields[table->column[DIRECTION]];

	if (!strcmp(text, "down") || !strcmp(text, "descending"))
		return true;
	if (!strcmp(text, "up") || !strcmp(text, "ascending"))
		return false;
	cli_fail("%s:%d: direction: expected up or down, found '%s'; correct it",
		 table->path, table->line, text);
}

static struct incise_calibrate_force_pair read_pair(const struct table *table,
						    char **fields)
{
	struct incise_calibrate_force_pair pair = {.mass_g = NAN};
	double series;

	if (table->column[MASS] >= 0)
		pair.mass_g = number_of(table, MASS, fields);
	else
		pair.force_N = number_of(table, FORCE, fields);
	pair.reading_mV = number_of(table, READING, fields);
	if (table->column[SERIES] >= 0) {
		series = number_of(table, SERIES, fields);
		if (series != floor(series) || fabs(series) > 1e6)
			cli_fail("%s:%d: series: expected a whole number from -1000000 "
				 "to 1000000; correct it",
				 table->path, table->line);
		pair.series = (int)series;
	}
	if (table->column[DIRECTION] >= 0)
		pair.descending = descends(table, fields);
	return pair;
}

void pairs_read(struct pairs *pairs, const char *path)
{
	struct table table = {.path = path};
	char *line, *fields[COLUMNS_MAX];
	struct incise_infile *in = calibrate_open(path);
	int columns = 0;

	*pairs = (struct pairs){0};
	while (calibrate_line(in, &line)) {
		struct incise_calibrate_force_pair pair;
		int n;

		table.line++;
		n = calibrate_cut(path, table.line, line, fields, COLUMNS_MAX, " \t\"",
				  " \t\"");
		if (fields[0][0] == '#' || (n == 1 && !*fields[0]))
			continue;
		if (!columns) {
			read_header(&table, fields, n);
			columns = n;
			continue;
		}
		calibrate_width(path, table.line, n, columns);
		pair = read_pair(&table, fields);
		add_pair(pairs, &pair);
	}
	incise_infile_close(in);
	if (!pairs->n)
		cli_fail("%s: no pairs; expected a line of column names (reading_mV, and "
			 "mass_g or force_N) and lines of numbers",
			 path);
}

void pairs_write(const struct pairs *pairs, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);
	bool masses = false;

	for (int i = 0; i < pairs->n; i++)
		masses |= !isnan(pairs->pair[i].mass_g);
	fprintf(out, "%s,reading_mV,series,direction\n", names[masses ? MASS : FORCE]);
	for (int i = 0; i < pairs->n; i++) {
		const struct incise_calibrate_force_pair *pair = &pairs->pair[i];

		fprintf(out, "%.10g,%.6f,%d,%s\n", masses ? pair->mass_g : pair->force_N,
			pair->reading_mV, pair->series, pair->descending ? "down" : "up");
	}
	whole_file_end(file);
}

/* --- weights -------------------------------------------------------------------------- */

/* A reading is steady when it has neither moved nor swung for so long. */
#define STEADY_S 2
#define POLL_NS (INCISE_NS_PER_S / 20)
#define BLOCK 4096
/* More than this is a weight that swings, 20 codes of a converter. */
#define SWING_CODES 20

static const struct cli_unit masses[] = {{"g", 1}, {"kg", 1e3}, {"mg", 1e-3}, {0}};

/* Mean and scatter of samples. */
struct mean {
	double mV, squares;
	long n, clipped;
};

void weights_parse(struct weights *weights, char *list)
{
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
				  "with --series",
				  weights->mass_g[i]);
	if (weights->n < 3)
		cli_usage("--weights: expected the empty pan and 2 weights or more, for "
			  "example 0,50g,100g; 5 are recommended");
}

void weights_ask(struct weights *weights)
{
	char *line = NULL;
	size_t size = 0;

	fprintf(stderr, "Enter the loads that you can put on the pan, for example "
			"0,50g,100g,200g,300g: ");
	if (getline(&line, &size, stdin) < 0)
		cli_fail("stopped before a load was entered; nothing has changed");
	line[strcspn(line, "\n")] = 0;
	weights_parse(weights, line);
	free(line);
}

static void add(struct mean *mean, double mV)
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
static struct mean read_for(struct incise_rig *rig, double s)
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
				add(&mean,
				    1e3 * (info.offset_V +
					   samples[i].code / (double)(1LL << info.bits) *
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
	if (cli_stop)
		cli_fail("stopped; the previous calibration stays active");
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
static void wait_steady(const struct weights *weights, double mass_g, double before_mV,
			double change_mV)
{
	const double step_mV = weights->setup->step_mV;
	double waited_s = 0;
	struct mean last = read_for(weights->rig, STEADY_S / 2.0), now;

	for (;;) {
		bool there;

		now = read_for(weights->rig, STEADY_S / 2.0);
		waited_s += STEADY_S / 2.0;
		there = is_terminal() || isnan(before_mV) || now.clipped ||
			fabs(now.mV - before_mV) >= fabs(change_mV) / 2;
		cli_progress("%g g: %.1f mV, sd %.1f mV %s", mass_g, now.mV, sd_of(&now),
			     is_steady(&last, &now, step_mV) ? "" : "(not steady)");
		if (there && is_steady(&last, &now, step_mV))
			break;
		if (waited_s >= weights->timeout_s)
			cli_fail("%g g: %s within %g s: %.1f mV, sd %.1f mV; nothing has "
				 "changed",
				 mass_g,
				 there ? "the reading did not become steady"
				       : "the load was not put on",
				 weights->timeout_s, now.mV, sd_of(&now));
		last = now;
	}
}

/* Ask for a load; on the virtual rig apply it. */
static void request_load(const struct weights *weights, double mass_g)
{
	struct incise_sim *sim = incise_rig_sim(weights->rig);
	struct incise_calibrate_force_pair load = {.mass_g = mass_g};

	if (sim) {
		incise_sim_load(sim, incise_calibrate_force_of(&load, weights->setup));
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
	for (int c = 0; c != '\n' && c != EOF && !cli_stop;)
		c = getchar();
	if (cli_stop || feof(stdin))
		cli_fail("stopped; the previous calibration stays active");
}

/* Whether the reading is within the converter's range. */
static bool within(const struct weights *weights,
		   const struct incise_calibrate_force_pair *pair)
{
	return pair && pair->reading_mV > weights->setup->low_mV &&
	       pair->reading_mV < weights->setup->high_mV;
}

static void read_load(const struct weights *weights, struct pairs *pairs, int series,
		      bool descending, int k)
{
	const double mass_g = weights->mass_g[k];
	const struct incise_calibrate_force_pair *last =
		pairs->n ? &pairs->pair[pairs->n - 1] : NULL;
	struct incise_calibrate_force_pair pair = {
		.mass_g = mass_g, .series = series, .descending = descending};
	double change_N = 0;
	struct mean mean;

	if (!last || last->mass_g != mass_g)
		request_load(weights, mass_g);
	if (last)
		change_N = incise_calibrate_force_of(&pair, weights->setup) -
			   incise_calibrate_force_of(last, weights->setup);
	wait_steady(weights, mass_g, last ? last->reading_mV : NAN,
		    within(weights, last) ? change_N * weights->setup->nominal_mV_N
					  : weights->setup->step_mV);
	mean = read_for(weights->rig, weights->mean_s);
	pair.reading_mV = mean.mV;
	weights->setup->dithered &= sd_of(&mean) >= weights->setup->step_mV / 2;
	/* Clipped noise shifts the mean: the reading counts as saturated, and is left out. */
	if (mean.clipped > mean.n / 1000)
		pair.reading_mV =
			mean.mV < (weights->setup->low_mV + weights->setup->high_mV) / 2
				? weights->setup->low_mV
				: weights->setup->high_mV;
	add_pair(pairs, &pair);
	cli_progress_end();
	fprintf(stderr, "%d%s %8g g %10.2f mV  sd %.2f mV\n", series,
		descending ? " down" : "   up", mass_g, mean.mV, sd_of(&mean));
}

void weights_measure(const struct weights *weights, struct pairs *pairs)
{
	const int top = weights->n - 1;

	*pairs = (struct pairs){0};
	weights->setup->dithered = true;
	for (int series = 1; series <= weights->series; series++) {
		for (int k = 0; k <= top; k++)
			read_load(weights, pairs, series, false, k);
		/* The last comes down by all loads, the others at once. */
		for (int k = series == weights->series ? top - 1 : 0; k >= 0; k--)
			read_load(weights, pairs, series, true, k);
	}
}
