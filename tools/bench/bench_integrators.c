// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error against run time of integrators; see bench_integrators.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_device.h"
#include "bench_integrators.h"
#include "../cli/cli.h"
#include "../cli/json.h"

#define N(array) (sizeof(array) / sizeof(*(array)))
#define TICK_S PERIOD_S
#define TICKS 2000
#define REPEATS 49
#define QUICK_REPEATS 5
/* Of a run that is timed, at least: short ones need no whole second of motion. */
#define TIMED_STEPS 4000
/* Beyond so many times the truth it is not coming back. */
#define DIVERGED 1e6
/* An exact one is exact to the roundings of 1000 steps with the force held, and to those
 * of the angle that a tick has: 140 rad at 1e9 N/m. */
#define EXACT 1e-9

/* Of which smaller steps are tried too. */
static const double swept[] = {1e3, 1e5};

static double force(int tick)
{
	return tick < TICKS / 2 ? 1 : 2;
}

static struct spring spring(double K_N_m)
{
	return (struct spring){
		.mass_kg = DEVICE_KG, .stiffness_N_m = K_N_m, .ratio = 0.1};
}

/* Places at the ends of all ticks; each part of the motion from where its force began. */
static void true_places(double K_N_m, double *places)
{
	struct spring s = spring(K_N_m);
	long double begin_x = 0, begin_v = 0, x = 0, v = 0;
	int since = 0;

	for (int k = 0; k < TICKS; k++) {
		if (k && force(k) != force(k - 1)) {
			since = k;
			begin_x = x;
			begin_v = v;
		}
		x = begin_x;
		v = begin_v;
		spring_truth(&s, force(k), (k + 1 - since) * (long double)TICK_S, &x, &v);
		places[k] = x;
	}
}

static void run(struct integration *in, int substeps, int ticks, double *places)
{
	for (int k = 0; k < ticks; k++) {
		double f = force(k);

		for (int i = 0; i < substeps; i++)
			in->step(in, f);
		places[k] = in->x;
	}
}

static void measure_error(struct integrator_row *row, const double *truth)
{
	static double places[TICKS];
	struct spring s = spring(row->K_N_m);
	struct integration in;
	double largest = 0, worst = 0, sum = 0;

	integration_init(&in, row->kind, &s, row->step_s);
	run(&in, lround(TICK_S / row->step_s), TICKS, places);
	for (int k = 0; k < TICKS; k++)
		largest = fmax(largest, fabs(truth[k]));
	for (int k = 0; k < TICKS; k++) {
		double off = fabs(places[k] - truth[k]) / largest;

		if (!(off < DIVERGED)) {
			row->diverged = true;
			row->max_error = row->rms_error = INFINITY;
			return;
		}
		worst = fmax(worst, off);
		sum += off * off;
	}
	row->max_error = worst;
	row->rms_error = sqrt(sum / TICKS);
}

static int timed_ticks(const struct integrator_row *row)
{
	int substeps = lround(TICK_S / row->step_s);

	return (TIMED_STEPS + substeps - 1) / substeps < TICKS
		       ? (TIMED_STEPS + substeps - 1) / substeps
		       : TICKS;
}

static void run_timed(void *context)
{
	static double places[TICKS];
	const struct integrator_row *row = context;
	struct spring s = spring(row->K_N_m);
	struct integration in;

	integration_init(&in, row->kind, &s, row->step_s);
	run(&in, lround(TICK_S / row->step_s), timed_ticks(row), places);
}

static void measure_times(struct integrator_bench *bench, int repeats)
{
	static struct harness_variant ways[INTEGRATOR_ROWS_MAX];
	static struct harness_time times[INTEGRATOR_ROWS_MAX];

	for (int i = 0; i < bench->n; i++)
		ways[i] = (struct harness_variant){.run = run_timed,
						   .context = &bench->row[i],
						   .units = timed_ticks(&bench->row[i])};
	harness_times(ways, bench->n, repeats, times);
	for (int i = 0; i < bench->n; i++)
		bench->row[i].ms_time = times[i];
}

static double ns_per_step(const struct integrator_row *row)
{
	return row->ms_time.ns.median * row->step_s / TICK_S;
}

static void add(struct integrator_bench *bench, enum integrator kind, double K,
		int substeps, const double *truth)
{
	struct integrator_row row = {
		.kind = kind, .K_N_m = K, .step_s = TICK_S / substeps};

	if (bench->n == INTEGRATOR_ROWS_MAX)
		cli_fail("integrators: more than %d rows", INTEGRATOR_ROWS_MAX);
	measure_error(&row, truth);
	bench->row[bench->n++] = row;
}

void bench_integrators(struct integrator_bench *bench, bool quick)
{
	static const double stiffness[] = {1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
	static double truth[TICKS];

	for (size_t i = 0; i < N(stiffness); i += quick ? 2 : 1) {
		true_places(stiffness[i], truth);
		for (int kind = 0; kind < INTEGRATORS; kind++)
			add(bench, kind, stiffness[i], 1, truth);
	}
	bench->table = bench->n;
	/* Work against precision: smaller and smaller steps. */
	for (size_t i = 0; i < N(swept); i++) {
		true_places(swept[i], truth);
		for (int kind = 0; kind < EXACT_ZOH; kind++)
			for (int substeps = 2; substeps <= (quick ? 16 : 1024);
			     substeps *= quick ? 8 : 2)
				add(bench, kind, swept[i], substeps, truth);
	}
	measure_times(bench, quick ? QUICK_REPEATS : REPEATS);
}

static bool must_be_exact(const struct integrator_row *row)
{
	return row->kind == EXACT_ZOH || row->kind == PLANT;
}

int integrator_bench_missed(const struct integrator_bench *bench)
{
	int missed = 0;

	for (int i = 0; i < bench->n; i++)
		missed += must_be_exact(&bench->row[i]) &&
			  !(bench->row[i].max_error <= EXACT);
	return missed;
}

/* The cheapest way to each error; all of them are in the JSON. */
static void print_work(const struct integrator_bench *bench, double K,
		       enum integrator kind)
{
	static const double errors[] = {1e-2, 1e-4, 1e-6, 1e-9};

	printf("%21s%10g", integrator_name(kind), K);
	for (size_t e = 0; e < N(errors); e++) {
		double least = INFINITY;

		for (int i = 0; i < bench->n; i++) {
			const struct integrator_row *row = &bench->row[i];

			if (row->kind == kind && row->K_N_m == K &&
			    row->max_error <= errors[e])
				least = fmin(least, row->ms_time.ns.median);
		}
		if (isinf(least))
			printf("%12s", "-");
		else
			printf("%12.1f", least);
	}
	putchar('\n');
}

void integrator_bench_print(const struct integrator_bench *bench)
{
	printf("integrators of a spring: %g kg, ratio of damping 0.1, steps of 1 ms; largest "
	       "error as part of the largest place\n%21s",
	       DEVICE_KG, "N/m");
	for (int i = 0; i < bench->table; i += INTEGRATORS)
		printf("%10g", bench->row[i].K_N_m);
	printf("%10s\n", "ns/step");
	for (int kind = 0; kind < INTEGRATORS; kind++) {
		printf("%21s", integrator_name(kind));
		for (int i = kind; i < bench->table; i += INTEGRATORS)
			if (bench->row[i].diverged)
				printf("%10s", "diverged");
			else
				printf("%10.2g", bench->row[i].max_error);
		/* Of the second stiffness: nothing overflows there. */
		printf("%10.1f\n", ns_per_step(&bench->row[INTEGRATORS + kind]));
	}
	printf("ns for 1 ms of motion, by the largest error that it has with the best of the "
	       "steps tried\n%21s%10s%12s%12s%12s%12s\n",
	       "", "N/m", "1e-2", "1e-4", "1e-6", "1e-9");
	for (size_t i = 0; i < N(swept); i++)
		for (int kind = 0; kind < INTEGRATORS; kind++)
			print_work(bench, swept[i], kind);
	putchar('\n');
}

json_t *integrator_bench_json(const struct integrator_bench *bench)
{
	json_t *rows = json_array();

	for (int i = 0; i < bench->n; i++) {
		const struct integrator_row *row = &bench->row[i];

		const struct harness_spread *ms = &row->ms_time.ns;

		json_array_append_new(
			rows, json_pack("{ss so so so so so so so so ss?}", "integrator",
					integrator_name(row->kind), "K_N_m",
					json_number(row->K_N_m), "step_s",
					json_number(row->step_s), "max_error",
					json_number(row->max_error), "rms_error",
					json_number(row->rms_error), "ns_per_step",
					json_number(ns_per_step(row)), "ns_per_ms",
					json_number(ms->median), "ns_per_ms_p5",
					json_number(ms->p5), "ns_per_ms_p95",
					json_number(ms->p95), "failed",
					row->diverged ? "diverged" : NULL));
	}
	return rows;
}

void integrator_bench_figures(const struct integrator_bench *bench, json_t *figures)
{
	for (int i = 0; i < bench->table; i++) {
		const struct integrator_row *row = &bench->row[i];

		/* A time of one spring tells that of all. */
		if (row->K_N_m == swept[0])
			metrics_time(figures, &row->ms_time, "ns", "%s step",
				     integrator_name(row->kind));
		if (row->K_N_m == swept[0] || row->K_N_m == swept[1])
			metrics_exact(figures, row->max_error, "1",
				      "%s largest error at %g N/m",
				      integrator_name(row->kind), row->K_N_m);
	}
}
