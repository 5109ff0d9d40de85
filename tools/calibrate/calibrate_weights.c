// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Weights on the force channel; see calibrate_weights.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/sim.h>
#include "calibrate_weights.h"
#include "../cli/cli.h"

/* A reading is steady when it has neither moved nor swung for so long. */
#define STEADY_S 2
#define POLL_NS (INCISE_NS_PER_S / 20)
#define BLOCK 4096
/* More than this is a weight that swings, 20 codes of a converter. */
#define SWING_CODES 20

static const struct cli_unit masses[] = {{"g", 1}, {"kg", 1e3}, {"mg", 1e-3}, {0}};

/* Mean and scatter of what came while something was awaited. */
struct mean {
	double mV, squares;
	long n, clipped;
};

static int by_mass(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

void calibrate_weights_list(struct calibrate_weights *weights, char *list)
{
	char *items[CALIBRATE_WEIGHTS_MAX];
	int n = cli_list("weights", list, items, CALIBRATE_WEIGHTS_MAX - 1);

	weights->n = 0;
	for (int i = 0; i < n; i++)
		weights->mass_g[weights->n++] =
			cli_quantity("--weights", items[i], masses, 0, 1e6);
	qsort(weights->mass_g, n, sizeof(*weights->mass_g), by_mass);
	/* The empty pan is a load that costs nothing and has no error. */
	if (weights->mass_g[0] > 0) {
		memmove(weights->mass_g + 1, weights->mass_g,
			n * sizeof(*weights->mass_g));
		weights->mass_g[0] = 0;
		weights->n++;
	}
	for (int i = 1; i < weights->n; i++)
		if (weights->mass_g[i] == weights->mass_g[i - 1])
			cli_usage("--weights: %g g is there twice; --series repeats",
				  weights->mass_g[i]);
	if (weights->n < 3)
		cli_usage(
			"--weights: 2 weights or more beside the empty pan are needed, 5 "
			"are good");
}

void calibrate_weights_ask(struct calibrate_weights *weights)
{
	char *line = NULL;
	size_t size = 0;

	fprintf(stderr, "Which weights are there, together on the pan? Such as "
			"0,50g,100g,200g,300g: ");
	if (getline(&line, &size, stdin) < 0)
		cli_fail("stopped before a weight was named; nothing has changed");
	line[strcspn(line, "\n")] = 0;
	calibrate_weights_list(weights, line);
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

/* What the channel reads within the next @s seconds. */
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
	/* what has waited is of before */
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
		cli_fail("stopped; the calibration stays as it was");
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
 * Wait until a load is there and still. @before_mV: what was read before it, NAN for
 * nothing; without a person who says so, the reading has to be half of @change_mV off.
 */
static void wait_steady(const struct calibrate_weights *weights, double mass_g,
			double before_mV, double change_mV)
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
				 there ? "the reading did not get steady"
				       : "the load did not come",
				 weights->timeout_s, now.mV, sd_of(&now));
		last = now;
	}
}

/* On the virtual rig, the one who hangs weights is this program. */
static void bring(const struct calibrate_weights *weights, double mass_g)
{
	struct incise_sim *sim = incise_rig_sim(weights->rig);
	struct incise_calibrate_force_pair load = {.mass_g = mass_g};

	if (sim) {
		incise_sim_load(sim, incise_calibrate_force_of(&load, weights->setup));
		return;
	}
	cli_progress_end();
	if (mass_g > 0)
		fprintf(stderr, "Put on %g g in all", mass_g);
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
		cli_fail("stopped; the calibration stays as it was");
}

/* A reading at the converter's end does not say how far it is to the next. */
static bool within(const struct calibrate_weights *weights,
		   const struct incise_calibrate_force_pair *pair)
{
	return pair && pair->reading_mV > weights->setup->low_mV &&
	       pair->reading_mV < weights->setup->high_mV;
}

static void read_load(const struct calibrate_weights *weights,
		      struct calibrate_pairs *pairs, int series, bool descending, int k)
{
	const double mass_g = weights->mass_g[k];
	const struct incise_calibrate_force_pair *last =
		pairs->n ? &pairs->pair[pairs->n - 1] : NULL;
	struct incise_calibrate_force_pair pair = {
		.mass_g = mass_g, .series = series, .descending = descending};
	double change_N = 0;
	struct mean mean;

	if (!last || last->mass_g != mass_g)
		bring(weights, mass_g);
	if (last)
		change_N = incise_calibrate_force_of(&pair, weights->setup) -
			   incise_calibrate_force_of(last, weights->setup);
	wait_steady(weights, mass_g, last ? last->reading_mV : NAN,
		    within(weights, last) ? change_N * weights->setup->nominal_mV_N
					  : weights->setup->step_mV);
	mean = read_for(weights->rig, weights->mean_s);
	pair.reading_mV = mean.mV;
	weights->setup->dithered &= sd_of(&mean) >= weights->setup->step_mV / 2;
	/* Cut-off noise bends a mean: it counts as at the end, where it is left out. */
	if (mean.clipped > mean.n / 1000)
		pair.reading_mV =
			mean.mV < (weights->setup->low_mV + weights->setup->high_mV) / 2
				? weights->setup->low_mV
				: weights->setup->high_mV;
	calibrate_pairs_add(pairs, &pair);
	cli_progress_end();
	fprintf(stderr, "%d%s %8g g %10.2f mV  sd %.2f mV\n", series,
		descending ? " down" : "   up", mass_g, mean.mV, sd_of(&mean));
}

void calibrate_weights_read(const struct calibrate_weights *weights,
			    struct calibrate_pairs *pairs)
{
	const int top = weights->n - 1;

	*pairs = (struct calibrate_pairs){0};
	weights->setup->dithered = true;
	for (int series = 1; series <= weights->series; series++) {
		for (int k = 0; k <= top; k++)
			read_load(weights, pairs, series, false, k);
		/* The last comes down by all loads, the others at once. */
		for (int k = series == weights->series ? top - 1 : 0; k >= 0; k--)
			read_load(weights, pairs, series, true, k);
	}
}
