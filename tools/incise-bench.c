// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench precision: error against run time of the model's arithmetics, on this
 * machine, in one run.
 */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "cli.h"
#include "json.h"

enum { OPT_JSON = CLI_LONG };

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_verb verb = {
	.name = "bench",
	.synopsis = "precision [MODEL.fis] [OPTIONS]",
	.summary =
		"Measure error against run time of a model's arithmetics. Without MODEL a\n"
		"model of the paper's size (20 rules) is made.",
	.options = options,
	.notes = "Exit: 0 measured, 1 failed, 2 bad usage. See incise-bench(1).",
};

#define POINTS 20000
#define REPEATS 31

struct row {
	const char *name;
	double ns, max_error_N, rms_error_N;
};

struct bench {
	struct incise_model *model;
	struct incise_fixed *fixed;
	double x[POINTS][INCISE_MODEL_INPUTS_MAX];
	int32_t q[POINTS][INCISE_FIXED_INPUTS_MAX];
	double truth[POINTS];
};

/* Paper 1's shape with a force surface of its kind. */
static struct incise_model *own_model(void)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 3};
	static const int mfs[] = {5, 4};
	struct incise_error err = {0};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_GAUSS, &out, &err);

	if (!model)
		cli_fail_with(&err);
	for (int r = 0; r < incise_model_n_rules(model); r++) {
		double d = r / 4 * 5.0, v = r % 4 * 50.0 / 3;
		double p[] = {0.05 * d + 0.01 * v - 0.3, 0.05 + 0.002 * d,
			      0.01 - 0.0001 * v};

		incise_model_set_consequent(model, r, p);
	}
	return model;
}

/* Eq. (3) in long double, written apart from the library's evaluator. */
static double reference(const struct incise_model *model, const double *x)
{
	long double sum = 0, weights = 0;

	for (int r = 0; r < incise_model_n_rules(model); r++) {
		const double *p = incise_model_consequent(model, r);
		long double exponent = 0, y = p[0];

		for (int i = 0; i < incise_model_n_inputs(model); i++) {
			const struct incise_mf *mf = incise_model_mf(
				model, i, incise_model_rule_mf(model, r, i));
			long double z = (x[i] - (long double)mf->p[1]) / mf->p[0];

			exponent += z * z / 2;
			y += (long double)p[i + 1] * x[i];
		}
		/* Within a support as wide as 11000 widths long double does not underflow. */
		sum += expl(-exponent) * y;
		weights += expl(-exponent);
	}
	return (double)(sum / weights);
}

static void fill(struct bench *b)
{
	uint64_t seed = 1;
	int n = incise_model_n_inputs(b->model);

	for (int k = 0; k < POINTS; k++) {
		for (int i = 0; i < n; i++) {
			const struct incise_variable *v = incise_model_input(b->model, i);

			seed = seed * 6364136223846793005u + 1442695040888963407u;
			b->x[k][i] = v->min + (v->max - v->min) * (seed >> 11) * 0x1p-53;
			b->q[k][i] = (int32_t)lrint(b->x[k][i] * INCISE_FIXED_ONE);
		}
		b->truth[k] = reference(b->model, b->x[k]);
	}
}

static double now_ns(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * 1e9 + t.tv_nsec;
}

static double eval_double(const struct bench *b, int k)
{
	return incise_model_eval(b->model, b->x[k], NULL);
}

static double eval_fixed(const struct bench *b, int k)
{
	return incise_fixed_eval(b->fixed, b->q[k]) / (double)INCISE_FIXED_ONE;
}

static int by_value(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
	static double (*const evals[])(const struct bench *, int) = {eval_double,
								     eval_fixed};
	struct row rows[] = {{.name = "double_libm"}, {.name = "fixed_direct"}};
	static double times[2][REPEATS];
	struct incise_error err = {0};
	struct bench *b = calloc(1, sizeof(*b));
	volatile double sink = 0;
	json_t *list = json_array();
	bool json = false;
	int opt;

	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		if (opt == OPT_JSON)
			json = true;
	if (optind >= argc || strcmp(argv[optind], "precision") || argc - optind > 2)
		cli_usage("expected 'precision' and at most one model");
	if (!b)
		cli_fail("no memory");
	b->model = argc - optind == 2 ? incise_model_load(argv[optind + 1], &err)
				      : own_model();
	if (!b->model)
		cli_fail_with(&err);
	b->fixed = incise_fixed_compile(b->model, NULL, &err);
	if (!b->fixed)
		cli_fail_with(&err);
	fill(b);
	for (int i = 0; i < 2; i++) {
		double sum = 0;

		for (int k = 0; k < POINTS; k++) {
			double e = fabs(evals[i](b, k) - b->truth[k]);

			rows[i].max_error_N = fmax(rows[i].max_error_N, e);
			sum += e * e / POINTS;
		}
		rows[i].rms_error_N = sqrt(sum);
	}
	/* Interleaved, so that a busy moment of the machine meets both. */
	for (int rep = 0; rep < REPEATS; rep++)
		for (int i = 0; i < 2; i++) {
			double begin = now_ns();

			for (int k = 0; k < POINTS; k++)
				sink += evals[i](b, k);
			times[i][rep] = (now_ns() - begin) / POINTS;
		}
	if (!json)
		printf("%-14s %10s %12s %12s   (median of %d runs of %d points)\n",
		       "arithmetic", "ns", "largest / N", "rms / N", REPEATS, POINTS);
	for (int i = 0; i < 2; i++) {
		qsort(times[i], REPEATS, sizeof(double), by_value);
		rows[i].ns = times[i][REPEATS / 2];
		if (!json)
			printf("%-14s %10.1f %12.3g %12.3g\n", rows[i].name, rows[i].ns,
			       rows[i].max_error_N, rows[i].rms_error_N);
		json_array_append_new(list, json_pack("{ss sf sf sf so}", "name",
						      rows[i].name, "ns", rows[i].ns,
						      "max_error_N", rows[i].max_error_N,
						      "rms_error_N", rows[i].rms_error_N,
						      "bound_N", json_null()));
	}
	if (json)
		json_print(json_pack("{so}", "rows", list));
	else
		json_decref(list);
	cli_finish();
	incise_model_free(b->model);
	free(b);
	return 0;
}
