// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench realism [DATA]: how alike the texture of rendered and of recorded cuts is, on the half of the
 * cuts that was held out; for the model alone, coloured noise, and the learned texture.
 *
 *   DATA, or simulated rigs ─▶ halves of the cuts ─┬─▶ model, texture ─▶ rendered ─┬─▶ rows
 *                                                  └─▶ recorded ───────────────────┘
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/corpus.h>
#include "../cli/child.h"
#include "../cli/folder.h"
#include "../train/sources.h"
#include "bench.h"

/* Simulated rigs: teeth of other sizes and lengths, on tissue that is held in other ways. */
static const char *const rigs[][2] = {
	{"rig 1", "seed=101,tooth=0.2,tooth_mm=1.5"},
	{"rig 2", "seed=202,tooth=0.1,tooth_mm=0.8"},
	{"rig 3", "seed=303,tooth=0.35,tooth_mm=3"},
	{"rig 4", "seed=404,tooth=0.15,tooth_mm=2,boundary=0.05,force_noise_mV=6"},
	{"rig 5", "seed=505,tooth=0.3,tooth_mm=1,boundary=0.15"},
};

#define SEEDS 2 /* divisions into halves */

static const char *const kinds[INCISE_REALISM_KINDS] = {"none", "noise", "texture"};

struct row {
	const char *set, *kind;
	int cuts, events;
	double up_to_cycles_mm, rate_low, rate_high, recorded_skewness;
	struct incise_realism_row is;
};

static int watch_stop(void *user, const struct incise_train_step *step)
{
	(void)user;
	(void)step;
	return cli_stop;
}

/* Train on half of the cuts, and compare on the other one. */
static void measure_half(struct incise_train_source *source, uint64_t seed,
			 struct incise_realism *realism)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_sources_options options = {.columns = columns,
						 .n_inputs = 2,
						 .group = "cut",
						 .check = 0.5,
						 .type = INCISE_MF_GAUSS,
						 .n_mfs = {5, 4}};
	struct incise_texture *texture;
	struct incise_trained trained;
	struct incise_error err = {0};

	incise_train_options_init(&options.train);
	options.train.seed = seed;
	options.train.progress = watch_stop;
	cli_check(incise_train_sources(source, 1, &options, &trained, &err), &err);
	texture =
		incise_train_texture(source, 1, &trained, &options.train, realism, &err);
	incise_texture_free(cli_require(texture, &err));
	incise_trained_free(&trained);
}

/* Add a division to the row of a kind, which has the mean of @divisions. */
static void add_division(struct row *row, const struct incise_realism *r,
			 const char *name, int kind, int divisions)
{
	const double *from = (const double *)&r->kind[kind];
	double *to = (double *)&row->is;

	row->set = name;
	row->kind = kinds[kind];
	row->cuts += r->cuts;
	row->events += r->events;
	row->up_to_cycles_mm += r->up_to_cycles / divisions;
	row->rate_low += r->rate_low / divisions;
	row->rate_high += r->rate_high / divisions;
	row->recorded_skewness += r->skewness / divisions;
	for (size_t i = 0; i < sizeof(row->is) / sizeof(*to); i++)
		to[i] += from[i] / divisions;
}

/* Add the mean over the divisions of one file to rows of their kinds. */
static void measure_file(char *path, const char *name, int seeds, struct row *row)
{
	struct recording_rows all = {0};
	struct incise_train_source *source = sources_new(&path, 1, &all);

	for (int s = 0; s < seeds; s++) {
		struct incise_realism r;

		cli_progress("realism: %s, division %d of %d", name, s + 1, seeds);
		measure_half(source, (uint64_t)s + 1, &r);
		for (int k = 0; k < INCISE_REALISM_KINDS; k++)
			add_division(&row[k], &r, name, k, seeds);
	}
	cli_progress_end();
	sources_free(source, 1);
}

/* Record a rig as a user does, and measure the recording. */
static void measure_rig(int i, bool quick, struct row *row)
{
	char folder[200], *path, *spec;
	int status;

	folder_make(folder, sizeof(folder), "the recording");
	path = cli_text("%s/rig.rec", folder);
	spec = cli_text("sim:clock=simulated,force_hz=1000,%s%s", rigs[i][1],
			quick ? ",cut_s=3" : "");
	cli_progress("realism: recording %s", rigs[i][0]);
	status = child_run((char *[]){cli_text("%s/incise-capture", cli_folder()), "-o",
				      path, "--rig", spec, "-c", "none", "--camera",
				      "off", "--json", NULL},
			   -1, -1, STDERR_FILENO);
	if (!status)
		measure_file(path, rigs[i][0], quick ? 1 : SEEDS, row);
	folder_remove(folder);
	if (status)
		cli_fail("realism: 'incise capture --rig %s' failed, see above", spec);
	free(path), free(spec);
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "set", set, "%-12s", "cuts of"),
		    COLUMN(row, "kind", kind, "%-8s", "texture"),
		    COLUMN(row, "cuts", cuts),
		    COLUMN(row, "events", events, "%7.0f", "events"),
		    COLUMN(row, "up_to_cycles_mm", up_to_cycles_mm),
		    COLUMN(row, "event_rate", is.rate, "%6.2f", "rate"),
		    COLUMN(row, "event_rate_low", rate_low, "  (%4.2f", ""),
		    COLUMN(row, "event_rate_high", rate_high, "to %4.2f)", ""),
		    COLUMN(row, "drops_ks", is.drops, "%6.2f", "drops"),
		    COLUMN(row, "spectrum_dB", is.spectrum_dB, "%8.1f", "dB"),
		    COLUMN(row, "rms", is.rms, "%6.2f", "rms"),
		    COLUMN(row, "skewness", is.skewness, "%9.2f", "skewness"),
		    COLUMN(row, "recorded_skewness", recorded_skewness, "  (%5.2f)", ""),
		    COLUMN(row, "mean_force", is.mean_force, "%8.2f", "mean, %",
			   .text_scale = 100)},
	.metrics = {METRIC(EXACT, row, is.spectrum_dB, "dB",
			   "spectrum of {set}, {kind}")},
};

static void run(struct bench_run *run)
{
	const int n = run->n_operands || run->quick ? 1 : N(rigs);
	struct row *rows = cli_alloc((size_t)n * INCISE_REALISM_KINDS, sizeof(*rows));

	for (int i = 0; i < n; i++)
		if (run->n_operands)
			measure_file(run->operands[0], run->operands[0],
				     run->quick ? 1 : SEEDS, rows);
		else
			measure_rig(i, run->quick,
				    rows + INCISE_REALISM_KINDS * (size_t)i);
	bench_values(run, "{si}", "divisions", run->quick ? 1 : SEEDS);
	bench_text(
		run,
		"%s\nCuts that were held out, rendered divided by recorded: rate of events "
		"(95 %% interval of the recorded one), rms of the texture; drops: distance of "
		"Kolmogorov and Smirnov; dB: of octaves; skewness of differences (recorded)\n",
		bench_machine(run, "cpu"));
	bench_table(run, &rows_table, rows, n * INCISE_REALISM_KINDS);
}

const struct bench bench_realism = {
	.name = "realism",
	.operands = "[DATA]",
	.summary = "texture of rendered cuts next to recorded ones",
	.n_operands = 1,
	.run = run,
};
