// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * How long training takes: 120 pairs, 20 rules, as in paper 1, classic and default, on
 * data made here.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/train.h>
#include "bench_training.h"
#include "cli.h"
#include "json.h"
#include "machine.h"
#include "stopwatch.h"

#define PAIRS 120
#define EPOCHS 80
#define REPEATS 21
#define QUICK_REPEATS 3

static const struct {
	const char *name;
	bool classic;
} ways[] = {{"classic", true}, {"default", false}};
#define WAYS (sizeof(ways) / sizeof(*ways))

/* Cuts of 10 pairs each, a force that rises with depth and velocity, some noise. */
static void make_pairs(double *rows, int *groups)
{
	uint64_t seed = 1;

	for (int i = 0; i < PAIRS; i++) {
		double *row = rows + 3 * i, noise[3];

		for (int k = 0; k < 3; k++) {
			seed = seed * 6364136223846793005u + 1442695040888963407u;
			noise[k] = (seed >> 11) * 0x1p-53;
		}
		row[0] = 20 * noise[0];
		row[1] = 50 * noise[1];
		row[2] = row[0] * (0.045 + 0.0028 * row[0]) *
				 (1 + 0.35 * row[1] / (row[1] + 15)) +
			 0.1 * (noise[2] - 0.5);
		groups[i] = i / 10;
	}
}

static double train_once(bool classic, const double *rows, const int *groups)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 3};
	static const int mfs[] = {5, 4};
	struct incise_pairs pairs = {rows, PAIRS, 2};
	struct incise_train_options options;
	struct incise_error err = {0};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_GAUSS, &out, &err);
	double ns;

	if (!model)
		cli_fail_with(&err);
	incise_train_options_init(&options);
	options.classic = classic;
	options.epochs = EPOCHS;
	options.groups = groups;
	ns = stopwatch_ns();
	if (incise_train(model, &pairs, NULL, &options, NULL, &err))
		cli_fail_with(&err);
	ns = stopwatch_ns() - ns;
	incise_model_free(model);
	return ns * 1e-6;
}

void bench_training(bool json, bool quick)
{
	int repeats = quick ? QUICK_REPEATS : REPEATS, groups[PAIRS];
	double ms[WAYS][REPEATS], rows[PAIRS * 3];
	json_t *list = json_array();
	struct machine machine;

	machine_init(&machine);
	make_pairs(rows, groups);
	/* Interleaved, so that a busy moment of the machine meets both. */
	for (int r = -1; r < repeats; r++)
		for (size_t w = 0; w < WAYS; w++) {
			double t = train_once(ways[w].classic, rows, groups);

			/* The first is for warming up. */
			if (r >= 0)
				ms[w][r] = t;
		}
	if (!json)
		printf("%s\n%d pairs, 20 rules, %d epochs at most; median of %d runs\n",
		       machine.cpu, PAIRS, EPOCHS, repeats);
	for (size_t w = 0; w < WAYS; w++) {
		stopwatch_sort(ms[w], repeats);
		if (!json)
			printf("%-8s %8.2f ms   (%.2f to %.2f)\n", ways[w].name,
			       ms[w][repeats / 2], ms[w][0], ms[w][repeats - 1]);
		json_array_append_new(list,
				      json_pack("{ss sf sf sf}", "name", ways[w].name,
						"ms", ms[w][repeats / 2], "ms_min",
						ms[w][0], "ms_max", ms[w][repeats - 1]));
	}
	if (json)
		json_print(json_pack("{so si si si so}", "machine",
				     machine_json(&machine), "pairs", PAIRS, "epochs",
				     EPOCHS, "repeats", repeats, "rows", list));
	else
		json_decref(list);
}
