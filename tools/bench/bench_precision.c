// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error against run time of a model's arithmetics; see bench_precision.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "arithmetics.h"
#include "bench_precision.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "harness.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"

/* Points for the errors. Times are of the first of them, so few that inputs and outputs
 * stay in the cache and the arithmetic is what is measured. */
#define POINTS 20000
#define TIMED_POINTS 2000
#define REPEATS 101
#define QUICK_REPEATS 5

/* Of one arithmetic: time per evaluation, errors in the output's unit. */
struct measured {
	struct harness_time time;
	double max_error, rms_error, bound;
};

struct bench {
	struct arithmetics all;
	struct points points;
	struct measured figures[ARITHMETICS_MAX];
	struct machine machine;
	int repeats;
	bool quick;
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

static void measure_errors(struct bench *b)
{
	for (int i = 0; i < b->all.n; i++) {
		struct arithmetic *a = &b->all.row[i];
		struct measured *f = &b->figures[i];

		*f = (struct measured){.max_error = NAN, .rms_error = NAN, .bound = NAN};
		if (*a->failed)
			continue;
		arithmetic_errors(a, &b->points, &f->max_error, &f->rms_error);
		if (a->fixed)
			f->bound = incise_fixed_bound(a->fixed);
		if (f->max_error > f->bound)
			snprintf(
				a->failed, sizeof(a->failed),
				"its error of %.3g exceeds its certified bound of %.3g: a "
				"fault of incise, please report it with the model",
				f->max_error, f->bound);
		else if (!isfinite(f->max_error))
			snprintf(a->failed, sizeof(a->failed),
				 "an answer is not a number");
	}
}

/* What a way of the harness does. */
struct timed {
	const struct arithmetic *arithmetic;
	const struct points *points;
};

static void run_timed(void *context)
{
	const struct timed *t = context;

	t->arithmetic->run(t->arithmetic, t->points);
}

static void measure_times(struct bench *b)
{
	struct harness_variant ways[ARITHMETICS_MAX];
	struct timed timed[ARITHMETICS_MAX];
	struct harness_time times[ARITHMETICS_MAX];
	struct points points = b->points;

	points.n = TIMED_POINTS;
	for (int i = 0; i < b->all.n; i++) {
		bool wrong = isnan(b->figures[i].max_error);

		timed[i] = (struct timed){&b->all.row[i], &points};
		ways[i] = (struct harness_variant){.run = run_timed,
						   .context = &timed[i],
						   .units = wrong ? 0 : TIMED_POINTS};
	}
	harness_times(ways, b->all.n, b->repeats, times);
	for (int i = 0; i < b->all.n; i++)
		b->figures[i].time = times[i];
}

/* How many times as fast as fuzzylite; NaN without it. */
static double against_peer(const struct bench *b, int i)
{
	for (int k = 0; k < b->all.n; k++)
		if (b->all.row[k].kind == ARITHMETIC_PEER)
			return b->figures[k].time.ns.median /
			       b->figures[i].time.ns.median;
	return NAN;
}

/* ---- report ---- */

static void print_number(const char *fmt, int width, double value)
{
	if (isnan(value))
		printf(" %*s", width, "-");
	else
		printf(fmt, width, value);
}

static void print_table(const struct bench *b, const struct incise_model *model)
{
	const struct machine *m = &b->machine;

	printf("model %s, %d rules; errors at %zu points, times of %d runs in turn\n"
	       "%s; %s; vectors: %s; %s%s%s\n\n"
	       "%-18s %9s %8s %8s %11s %11s %11s %11s\n",
	       incise_model_name(model), incise_model_n_rules(model), b->points.n,
	       b->repeats, m->cpu, m->kernel, m->vectors, m->compiler,
	       *b->all.peer_version ? "; fuzzylite " : "", b->all.peer_version,
	       "arithmetic", "median ns", "5 %", "95 %", "largest / N", "rms / N",
	       "bound / N", "x fuzzylite");
	for (int i = 0; i < b->all.n; i++) {
		const struct measured *f = &b->figures[i];

		printf("%-18s", b->all.row[i].name);
		print_number(" %*.1f", 9, f->time.ns.median);
		print_number(" %*.1f", 8, f->time.ns.p5);
		print_number(" %*.1f", 8, f->time.ns.p95);
		print_number(" %*.3g", 11, f->max_error);
		print_number(" %*.3g", 11, f->rms_error);
		print_number(" %*.3g", 11, f->bound);
		print_number(" %*.0f", 11, against_peer(b, i));
		putchar('\n');
	}
	putchar('\n');
	for (int i = 0; i < b->all.n; i++)
		if (*b->all.row[i].failed)
			printf("%s: %s\n", b->all.row[i].name, b->all.row[i].failed);
}

static json_t *row_json(const struct bench *b, int i)
{
	const struct arithmetic *a = &b->all.row[i];
	const struct measured *f = &b->figures[i];
	json_t *size = a->fixed ? json_integer(a->fixed->size) : json_null();
	json_t *failed = *a->failed ? json_string(a->failed) : json_null();

	return json_pack("{ss so so so so so so so so sb so}", "name", a->name, "ns",
			 json_number(f->time.ns.median), "ns_p5",
			 json_number(f->time.ns.p5), "ns_p95",
			 json_number(f->time.ns.p95), "max_error_N",
			 json_number(f->max_error), "rms_error_N",
			 json_number(f->rms_error), "bound_N", json_number(f->bound),
			 "size_bytes", size, "times_fuzzylite",
			 json_number(against_peer(b, i)), "peer",
			 a->kind == ARITHMETIC_PEER, "failed", failed);
}

static void print_json(const struct bench *b, const struct incise_model *model)
{
	json_t *rows = json_array(), *figures = json_array();

	for (int i = 0; i < b->all.n; i++) {
		const char *name = b->all.row[i].name;

		json_array_append_new(rows, row_json(b, i));
		/* A peer's hangs on where its heap lies: of one build and model it was
		 * from 1.7 to 3.5 us, by the process. */
		if (b->all.row[i].kind != ARITHMETIC_PEER)
			metrics_time(figures, &b->figures[i].time, "ns", "%s", name);
		metrics_exact(figures, b->figures[i].max_error, "N", "%s largest error",
			      name);
	}
	json_print(json_pack("{so si si si sb so ss? so so}", "model",
			     json_text(incise_model_name(model)), "rules",
			     incise_model_n_rules(model), "points", (int)b->points.n,
			     "repeats", b->repeats, "quick", b->quick, "machine",
			     machine_json(&b->machine), "fuzzylite_version",
			     *b->all.peer_version ? b->all.peer_version : NULL, "rows",
			     rows, "figures", figures));
}

/* ---- the work-precision chart ---- */

/* A block per kind: name, ns, its percentiles, largest error, bound. */
static void write_data(const struct bench *b, const char *folder, const char *name)
{
	char *data;
	FILE *out;

	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	out = plot_data(folder, data);
	free(data);
	for (int kind = 0; kind < ARITHMETIC_KINDS; kind++) {
		/* A block without points would shift the numbers of those behind it. */
		fputs("none NaN NaN NaN NaN NaN\n", out);
		for (int i = 0; i < b->all.n; i++) {
			const struct measured *f = &b->figures[i];

			if (b->all.row[i].kind != (enum arithmetic_kind)kind ||
			    isnan(f->time.ns.median))
				continue;
			/* An error of 0 has no place on a logarithmic axis. */
			fprintf(out, "%s %g %g %g %g %g\n", b->all.row[i].name,
				f->time.ns.median, f->time.ns.p5, f->time.ns.p95,
				fmax(f->max_error, 1e-18), f->bound);
		}
		fputs("\n\n", out);
	}
	plot_data_end(out, folder);
}

static void draw(const struct bench *b, const struct incise_model *model,
		 const char *folder, const char *name)
{
	static const char *const titles[ARITHMETIC_KINDS] = {
		"floating point",     "fixed, direct", "fixed, tables of weights",
		"fixed, force table", "batch",	       "fuzzylite"};
	double least = INFINITY, most = 0;
	FILE *script;

	/* With room for the last label. */
	for (int i = 0; i < b->all.n; i++) {
		least = fmin(least, b->figures[i].time.ns.median);
		most = fmax(most, b->figures[i].time.ns.median);
	}
	write_data(b, folder, name);
	script = plot_begin(folder, name, 1100, 800);
	fprintf(script,
		"set title \"Error over run time, %d rules\\n%s, %s\"\n"
		"set xlabel 'time per evaluation / ns (bars: 5 to 95 %% of the runs)'\n"
		"set ylabel 'largest error / N (thin lines: up to the certified bound)'\n"
		"set logscale xy\nset format y '%%.0e'\nset xrange [%g:%g]\n"
		"set yrange [*:*] extend\nset offsets 0, 0, graph 0.1, graph 0.05\n"
		"set key outside bottom center horizontal\ndata = '%s.dat'\nplot \\\n",
		incise_model_n_rules(model), b->machine.cpu, b->machine.kernel,
		least / 1.5, most * 3, name);
	for (int kind = 0; kind < ARITHMETIC_KINDS; kind++) {
		const char *style = kind == ARITHMETIC_PEER ? "lc rgb 'black'" : "ls";
		char number[4] = "";

		if (kind != ARITHMETIC_PEER)
			snprintf(number, sizeof(number), " %d", kind + 1);
		fprintf(script,
			"  data index %d using 2:5:(0):($6-$5) with vectors nohead %s%s lw 0.5, "
			"\\\n"
			"  '' index %d using 2:5:3:4 with xerrorbars %s%s pt 7 ps 0.8 "
			"title '%s', \\\n"
			"  '' index %d using 2:5:1 with labels left rotate by 25 offset 0.5,0.3 font ',8',  "
			"\\\n",
			kind, style, number, kind, style, number, titles[kind], kind);
	}
	fputs("  NaN\n", script);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void bench_precision(const char *path, bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;
	struct incise_error err = {0};
	struct incise_model *model;

	if (!b)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	model = path ? incise_model_load(path, &err) : own_model();
	if (!model)
		cli_fail_with(&err);
	b->quick = quick;
	b->repeats = quick ? QUICK_REPEATS : REPEATS;
	machine_init(&b->machine);
	arithmetics_init(&b->all, model);
	points_init(&b->points, model, quick ? TIMED_POINTS : POINTS);
	measure_errors(b);
	measure_times(b);
	if (json)
		print_json(b, model);
	else
		print_table(b, model);
	cli_finish();
	if (plot)
		draw(b, model, folder, name);
	/* Arithmetics and points live as long as the program. */
	incise_model_free(model);
	free(b);
}
