// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * how often the 95 % interval of a model holds new cuts on new rigs. Rigs
 * are virtual: each has its own errors of calibration, drawn from what it states, and measures the
 * force of the simulated tissue, which differs from cut to cut.
 *
 *   rigs that train ──► pairs, with the parts of their uncertainties ──► model and its interval
 *   other rigs      ──► cuts, measured with errors of their own      ──► within it or not
 *
 * Next to it the same pairs without uncertainties: a model that knows the scatter of its data only.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/sim.h>
#include "../../lib/learn/corpus.h"
#include "../../lib/learn/train.h"
#include "program.h"
#include "noise.h"
#include "../../tools/cli/stopwatch.h"

#define CUTS 12	   /* of a rig */
#define ROWS 40	   /* of a cut */
#define NEW_RIGS 8 /* per model */
#define NEW_CUTS 3 /* of each */
#define RIGS_MAX 12
#define PASSES 3
#define SCATTER 0.08 /* relative sd of the force from cut to cut */

/* Standard uncertainties that a rig states: of an ordinary calibration. */
static const struct {
	double gain, zero_N, tip_mm, surface_mm, force_N, depth_mm, velocity_mm_s;
} stated = {0.02, 0.02, 0.1, 0.1, 0.01, 0.03, 0.4};

static const struct incise_propagation_part parts[] = {{2, 0, true},   {2, 1, false},
						       {2, -1, false}, {0, 2, true},
						       {0, 3, true},   {0, -1, false},
						       {1, -1, false}};

#define WIDTH (3 + N(parts))

struct rig {
	char hash[65];
	double row[CUTS * ROWS][WIDTH];
};

struct row {
	int rigs, models;
	double covered_percent, low_percent,
		high_percent; /* of models: 5 and 95 % of them */
	double without_percent;
	double sd_N, data_N, model_N, calibration_N;
	const char *failed;
};

static const struct bench_table table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns =
		{
			COLUMN(row, "rigs", rigs),
			COLUMN(row, "models", models),
			COLUMN(row, "covered_percent", covered_percent),
			COLUMN(row, "covered_low_percent", low_percent),
			COLUMN(row, "covered_high_percent", high_percent),
			COLUMN(row, "without_percent", without_percent),
			COLUMN(row, "sd_N", sd_N),
			COLUMN(row, "sd_data_N", data_N),
			COLUMN(row, "sd_model_N", model_N),
			COLUMN(row, "sd_calibration_N", calibration_N),
			COLUMN(row, "failed", failed),
		},
};

/* --- virtual rigs --- */

/* A rig with its errors of calibration, which measures cuts. */
static void measure(struct rig *rig, uint64_t *random, int cuts)
{
	struct incise_sim_config tissue;
	double gain = stated.gain * noise_normal(random);
	double zero_N = stated.zero_N * noise_normal(random);
	double depth_off_mm = stated.tip_mm * noise_normal(random) +
			      stated.surface_mm * noise_normal(random);

	incise_sim_config_init(&tissue);
	for (int i = 0; i < 64; i++)
		rig->hash[i] = "0123456789abcdef"[incise_random_next(random) >> 60];
	rig->hash[64] = '\0';
	for (int cut = 0; cut < cuts; cut++) {
		double factor = 1 + SCATTER * noise_normal(random);
		double deepest_mm = 5 + 10 * noise_uniform(random);
		double speed_mm_s = 15 + 20 * noise_uniform(random);

		for (int i = 0; i < ROWS; i++) {
			double depth_mm = deepest_mm * (i + 1) / ROWS;
			double velocity_mm_s =
				speed_mm_s * (1 + 0.5 * sin(0.3 * i + cut));
			double force_N = factor * incise_sim_mean_force(&tissue, depth_mm,
									velocity_mm_s);
			double *row = rig->row[cut * ROWS + i];

			row[0] = depth_mm + depth_off_mm +
				 stated.depth_mm * noise_normal(random);
			row[1] = velocity_mm_s +
				 stated.velocity_mm_s * noise_normal(random);
			row[2] = force_N * (1 + gain) + zero_N +
				 stated.force_N * noise_normal(random);
			row[3] = stated.gain * row[2];
			row[4] = stated.zero_N;
			row[5] = stated.force_N;
			row[6] = stated.tip_mm;
			row[7] = stated.surface_mm;
			row[8] = stated.depth_mm;
			row[9] = stated.velocity_mm_s;
		}
	}
}

static int read_rig(void *user, incise_row_taker take, void *taker,
		    struct incise_error *err)
{
	const struct rig *rig = user;
	char cut[16];
	int rc = 0;

	for (int i = 0; i < CUTS * ROWS && !rc; i++) {
		snprintf(cut, sizeof(cut), "%02d", i / ROWS);
		rc = take(taker, rig->row[i], cut, err);
	}
	return rc;
}

/* --- models --- */

struct learning {
	struct incise_corpus *corpus;
	struct incise_corpus_source source[RIGS_MAX];
	int n;
	struct incise_propagation *propagation; /* NULL: without uncertainties */
	struct incise_factor *all;
	double scatter;
};

static struct incise_factor *sums(const struct learning *l,
				  const struct incise_model *premises)
{
	struct incise_error err = {0};
	struct incise_factor *factor =
		cli_require(incise_factor_new(premises, &err), &err);

	for (int i = 0; i < l->n; i++)
		if (incise_corpus_fold(l->corpus, &l->source[i], factor, NULL, &err))
			cli_fail_with(&err);
	return factor;
}

/* As incise train does it. */
static int all_sums(void *user, const struct incise_model *premises,
		    struct incise_factor **factor)
{
	const struct incise_factor_ridge ridge = {1e-3, 1};
	struct learning *l = user;
	struct incise_model *model = NULL, *next;
	struct incise_uncertainty *uncertainty;
	struct incise_error err = {0};

	if (!l->propagation)
		l->all = sums(l, premises);
	for (int pass = 0; pass < PASSES && l->propagation; pass++) {
		if (incise_propagation_start(l->propagation, model ? model : premises,
					     l->scatter, &err))
			cli_fail_with(&err);
		incise_factor_free(l->all);
		l->all = sums(l, premises);
		next = cli_require(incise_factor_solve(l->all, &ridge, NULL, &uncertainty,
						       NULL, &err),
				   &err);
		if (incise_propagation_end(l->propagation, next, uncertainty,
					   incise_factor_rmse(l->all, next, NULL),
					   &l->scatter, &err))
			cli_fail_with(&err);
		incise_uncertainty_free(uncertainty);
		incise_model_free(model);
		model = next;
	}
	incise_model_free(model);
	*factor = l->all;
	return 0;
}

static struct incise_model *learn(struct rig *rigs, int n, bool with,
				  struct incise_uncertainty **uncertainty)
{
	static const char *const names[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_variable ranges[3] = {0};
	double min[3], max[3];
	struct incise_train_options options;
	struct learning l = {.corpus =
				     incise_corpus_new(2, true, 1, INCISE_CORPUS_SAMPLE),
			     .n = n,
			     .scatter = 0.1};
	const struct incise_train_sums all = {
		.find = all_sums, .user = &l, .weighted = with};
	struct incise_train_report report;
	struct incise_error err = {0};
	const struct incise_corpus_side *fit;
	struct incise_model *model;
	int mfs[] = {3, 2};

	if (with) {
		l.propagation = cli_require(
			incise_propagation_new(2, parts, N(parts), &err), &err);
		incise_corpus_weigh(l.corpus, l.propagation);
	}
	for (int i = 0; i < n; i++) {
		l.source[i] = (struct incise_corpus_source){.name = "rig",
							    .hash = rigs[i].hash,
							    .text = "rig",
							    .group = "",
							    .own_groups = true,
							    .read = read_rig,
							    .user = &rigs[i]};
		if (incise_corpus_survey(l.corpus, &l.source[i], &err))
			cli_fail_with(&err);
	}
	if (incise_corpus_settle(l.corpus, 0, &err))
		cli_fail_with(&err);
	fit = incise_corpus_side(l.corpus, false);
	incise_corpus_ranges(l.corpus, min, max);
	for (int i = 0; i < 3; i++)
		ranges[i] = (struct incise_variable){.min = min[i], .max = max[i]};
	incise_train_options_init(&options);
	options.groups = fit->sample.groups;
	options.ranges = ranges;
	model = cli_require(incise_train_start(&fit->sample.pairs, names, INCISE_MF_GAUSS,
					       mfs, &options, &err),
			    &err);
	options.ranges = NULL;
	options.uncertainty = uncertainty;
	if (incise_train_sample(model, &fit->sample.pairs, NULL, &options, &all, &report,
				&err))
		cli_fail_with(&err);
	if (with && (incise_propagation_end(l.propagation, model, *uncertainty,
					    report.train_rmse, &l.scatter, &err) ||
		     incise_propagation_finish(l.propagation, *uncertainty, NULL, &err)))
		cli_fail_with(&err);
	incise_factor_free(l.all);
	incise_propagation_free(l.propagation);
	incise_corpus_free(l.corpus);
	return model;
}

/* Share of new cuts on new rigs within the interval; adds to the means of the parts. */
static double share_within(struct rig *rigs, int n, bool with, uint64_t seed,
			   struct row *means)
{
	struct incise_uncertainty *uncertainty = NULL;
	struct incise_model *model = learn(rigs, n, with, &uncertainty);
	struct rig *other = cli_alloc(1, sizeof(*other));
	const int pairs = NEW_CUTS * ROWS;
	long inside = 0;

	for (int r = 0; r < NEW_RIGS; r++) {
		measure(other, &seed, NEW_CUTS);
		for (int i = 0; i < pairs; i++) {
			const double *row = other->row[i], share = 1.0 / NEW_RIGS / pairs;
			struct incise_uncertainty_parts p;
			double e = incise_model_eval(model, row, NULL) - row[2];

			incise_uncertainty_parts(uncertainty, model, row, &p);
			inside += fabs(e) <= INCISE_INTERVAL95 * p.total;
			if (!means)
				continue;
			means->sd_N += share * p.total;
			means->data_N += share * p.data;
			means->model_N += share * p.model;
			means->calibration_N += share * hypot(p.calibration, p.rig);
		}
	}
	free(other);
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
	return (double)inside / NEW_RIGS / pairs;
}

static void measure_row(struct row *row, int rigs, int models, uint64_t seed)
{
	struct rig *train = cli_alloc(RIGS_MAX, sizeof(*train));
	double *share = cli_alloc((size_t)models, sizeof(*share));

	*row = (struct row){.rigs = rigs, .models = models};
	for (int m = 0; m < models && !cli_stop; m++) {
		uint64_t random = incise_random_mix(seed + 1000ULL * rigs + m), others;

		cli_progress("prediction: %d rigs, model %d of %d", rigs, m + 1, models);
		for (int r = 0; r < rigs; r++)
			measure(&train[r], &random, CUTS);
		others = random;
		share[m] = share_within(train, rigs, true, others, row);
		row->covered_percent += 100 * share[m] / models;
		row->without_percent +=
			100 * share_within(train, rigs, false, others, NULL) / models;
	}
	row->sd_N /= models;
	row->data_N /= models;
	row->model_N /= models;
	row->calibration_N /= models;
	stopwatch_sort(share, models);
	row->low_percent = 100 * share[models / 20];
	row->high_percent = 100 * share[models - 1 - models / 20];
	free(share);
	free(train);
}

static void run_prediction(struct bench_run *run)
{
	static const int rigs[] = {1, 3, RIGS_MAX};
	struct row *rows = cli_alloc(N(rigs), sizeof(*rows));
	int models = run->quick ? 4 : 60, n = run->quick ? 2 : N(rigs);

	for (int i = 0; i < n; i++)
		measure_row(&rows[i], rigs[i], models, 1);
	if (cli_stop)
		cli_fail("interrupted");
	bench_rows(run, &table, rows, n);
	for (int i = 0; i < n && !run->quick; i++)
		if (!(rows[i].covered_percent >= 92 && rows[i].covered_percent <= 98))
			bench_fail(run,
				   "%d rigs: the 95 %% interval holds %.1f %% of new "
				   "cuts, not 92 to 98",
				   rows[i].rigs, rows[i].covered_percent);
}

const struct bench bench_program = {
	.name = "prediction",
	.summary = "95 % interval of a model: share of new cuts on new rigs",
	.run = run_prediction,
};
