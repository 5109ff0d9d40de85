// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench realism [DATA]: how alike the texture of rendered and of recorded cuts is, on the half of the
 * cuts that was held out; for the model alone, coloured noise, and the learned texture.
 *
 *   DATA, or simulated rigs ─▶ halves of the cuts ─┬─▶ model, texture ─▶ rendered ─┬─▶ rows
 *                                                  └─▶ recorded ───────────────────┘
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
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

#define SEED 1 /* of the division into halves */

static const char *const kinds[INCISE_REALISM_KINDS] = {"none", "noise", "texture"};

struct row {
	const char *set, *kind;
	struct incise_realism of;
	struct incise_realism_row is;
};

static int watch_stop(void *user, const struct incise_train_step *step)
{
	(void)user;
	(void)step;
	return cli_stop;
}

/* Train on half of the cuts of a file, and compare the other one. */
static void measure_file(char *path, const char *name, struct row *row)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_sources_options options = {.columns = columns,
						 .n_inputs = 2,
						 .group = "cut",
						 .check = 0.5,
						 .type = INCISE_MF_GAUSS,
						 /* Smooth along the speed. */
						 .n_mfs = {3, 2}};
	struct recording_rows all = {0};
	struct incise_train_source *source = sources_new(&path, 1, &all);
	struct incise_error err = {0};
	struct incise_texture *texture;
	struct incise_trained trained;

	cli_progress("realism: %s", name);
	incise_train_options_init(&options.train);
	options.train.seed = SEED;
	options.train.progress = watch_stop;
	cli_check(incise_train_sources(source, 1, &options, &trained, &err), &err);
	texture =
		incise_train_texture(source, 1, &trained, &options.train, &row->of, &err);
	/* No texture is better than the model alone: they are the same then. */
	if (!texture && errno != EDOM)
		cli_fail("%s: %s", path, err.text);
	cli_progress_end();
	for (int k = INCISE_REALISM_KINDS - 1; k >= 0; k--)
		row[k] = (struct row){name, kinds[k], row->of, row->of.kind[k]};
	incise_texture_free(texture);
	incise_trained_free(&trained);
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
		measure_file(path, rigs[i][0], row);
	folder_remove(folder);
	if (status)
		cli_fail("realism: 'incise capture --rig %s' failed, see above", spec);
	free(path), free(spec);
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "set", set), COLUMN(row, "kind", kind),
		    COLUMN(row, "cuts", of.cuts), COLUMN(row, "events", of.events),
		    COLUMN(row, "up_to_cycles_mm", of.up_to_cycles),
		    COLUMN(row, "event_rate", is.rate),
		    COLUMN(row, "event_rate_low", of.rate_low),
		    COLUMN(row, "event_rate_high", of.rate_high),
		    COLUMN(row, "drops_ks", is.drops),
		    COLUMN(row, "spectrum_dB", is.spectrum_dB),
		    COLUMN(row, "rms", is.rms), COLUMN(row, "skewness", is.skewness),
		    COLUMN(row, "recorded_skewness", of.skewness),
		    COLUMN(row, "mean_force", is.mean_force)},
	.metrics = {METRIC(EXACT, row, is.spectrum_dB, "dB",
			   "spectrum of {set}, {kind}")},
};

static void run_realism(struct bench_run *run)
{
	const int n = run->n_operands || run->quick ? 1 : N(rigs);
	struct row *rows = cli_alloc((size_t)n * INCISE_REALISM_KINDS, sizeof(*rows));

	for (int i = 0; i < n; i++)
		if (run->n_operands)
			measure_file(run->operands[0], run->operands[0], rows);
		else
			measure_rig(i, run->quick,
				    rows + INCISE_REALISM_KINDS * (size_t)i);
	bench_rows(run, &rows_table, rows, n * INCISE_REALISM_KINDS);
}

const struct bench bench_realism = {
	.name = "realism",
	.operands = "[DATA]",
	.summary = "texture of rendered cuts next to recorded ones",
	.n_operands = 1,
	.run = run_realism,
};
