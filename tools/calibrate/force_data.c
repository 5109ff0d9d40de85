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
#include "force.h"
#include "table.h"

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

static void add_row(void *run, const struct table *table, const double *row)
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

void force_read(void *run, const char *path)
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

	table_read(path, &form, add_row, run);
}

void force_write(const void *run, FILE *out)
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

static const struct cli_unit masses[] = {{"g", 1}, {"kg", 1e3}, {"mg", 1e-3}, {0}};

/* Mean and scatter of samples. */
struct mean {
	double mV, squares;
	long n, clipped;
};

void weights_parse(void *to, char *list)
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
				  "with --series",
				  weights->mass_g[i]);
	if (weights->n < 3)
		cli_usage("--weights: expected the empty pan and 2 weights or more, for "
			  "example 0,50g,100g; 5 are recommended");
}

static void ask_weights(struct weights *weights)
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
	struct mean last = read_for(force->rig, STEADY_S / 2.0), now;

	for (;;) {
		bool there;

		now = read_for(force->rig, STEADY_S / 2.0);
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
static bool within(struct force *force, const struct incise_calibrate_force_pair *pair)
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
		    within(force, last) ? change_N * force->setup.nominal_mV_N
					: force->setup.step_mV);
	mean = read_for(force->rig, force->weights.mean_s);
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

void force_measure(void *run)
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
