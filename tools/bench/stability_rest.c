// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench stability: does a scene come to rest? Each case is a surface, a force, a device, a
 * tracker and an actuator, with a gain far too large: the plan refuses it and names one that it
 * accepts. A closed loop in time, which knows nothing of the plan's own search, leans on both.
 *
 *                                 ┌─ that gain ──▶ accepted?  leans: rests or swings    asked: none swings
 *   case ─▶ plan refuses, names ──┤
 *                                 └─ twice that ─▶ leans: swings or rests               asked: few would rest
 *
 * A refused case runs on a plan made for a device that is damped well enough: a plan's ticks do not
 * depend on the device.
 */
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../lib/base/vector.h"
#include "../cli/scene_argument.h"
#include "../cli/stopwatch.h"
#include "bench.h"
#include "closed_loop.h"
#include "sheet.h"

/* --- cases --- */

#define CELLS 50
#define RUN_S 8.0
#define LONG_S 40.0	/* for a run that swings: it may only be slow to fade */
#define NOISE_MM 0.02	/* of a tracker, as predict.h has it */
#define DAMPED_N_s_mm 1 /* a device on which no gain of these cases is refused */
#define MUCH 10.0	/* a gain that no device of these bears */
#define TWICE 2
#define FORCE_N 4.0 /* the scene's limit */

/* The whole group, or its file's name. */
static const char *const shapes[][2] = {
	{"plane", ""},
	{"sphere", "surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, -40.0]; "
		   "radius_mm = 40.0; };\n"},
	{"capsule", "surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0]; "
		    "to_mm = [60.0, 0.0, -55.0]; radius_mm = 55.0; };\n"},
	{"mesh", NULL},
	{"heights", NULL},
};

/* A force of about 1 N/mm, or of the model's file. */
static const struct force {
	const char *name, *tissue, *rest;
	bool inserts, model;
} forces[] = {
	{"wall", "reaction_N_mm = 1.0;", ""},
	{"averaged", "reaction_N_mm = 1.0;", "effects = { average_ticks = 16; };\n"},
	{"damper", "reaction_N_mm = 1.0; damping_N_s_mm = 0.01;", ""},
	{"skin", "reaction_N_mm = 1.0; skin_N_mm = 0.5; skin_friction = 0.5;", ""},
	{"insertion", "insertion_N_mm = 1.0;", "", true},
	{"spread", "insertion_N_mm = 0.5; spread_N_mm = 0.5;", "", true},
	{"membrane", "reaction_N_mm = 0.3;",
	 "membrane = { point_mm = [0.0, 0.0, -2.0]; radius_mm = 8.0; thickness_mm = 2.0; "
	 "puncture_N = 2.0; back_wall_mm = 4.0; };\n"},
	{"model", "withdrawal = \"dissipative\";", "", .model = true},
	{"model, paper", "withdrawal = \"paper\";", "", .model = true},
	{"model given", "withdrawal = \"dissipative\";", "", .model = true},
};

static char *liver, *given; /* files of models */
static struct memory_file files[N(shapes)];

/* Files of shapes and models, before all plans. */
static void make_files(void)
{
	liver = cli_text("%s/liver.fis", scene_argument_shipped());
	for (int i = 0; i < N(shapes); i++)
		if (!shapes[i][1])
			files[i] =
				sheet_of_waves(CELLS, !strcmp(shapes[i][0], "heights"));
}

struct lean_case {
	int shape, force;
	struct closed_loop loop; /* the device, the tracker and the actuator */
};

/* Its plan, on a device of that damping, or NULL with the reason. */
static struct incise_plan *lean_plan(const struct lean_case *lean, double gain,
				     double damping_N_s_mm, struct incise_scene **scene,
				     struct incise_error *err)
{
	const struct force *force = &forces[lean->force];
	struct closed_loop loop = lean->loop;
	struct memory_file file = memory_file_begin("case.scene");
	struct incise_tracker_info tracker = closed_loop_tracker(&loop);
	struct incise_plan *plan = NULL;
	size_t n = strlen(file.path);

	if (shapes[lean->shape][1])
		fputs(shapes[lean->shape][1], file.file);
	else
		fprintf(file.file, "surface = { kind = \"%s\"; file = \"%s\"; };\n",
			shapes[lean->shape][0], files[lean->shape].path);
	if (force->model)
		fprintf(file.file, "model = \"%s\";\n",
			lean->force == N(forces) - 1 ? given : liver);
	fprintf(file.file,
		"arithmetic = \"double\";\ntissue = { %s gain = %.9f; };\n%s"
		"device = { mass_kg = %.4f; damping_N_s_mm = %.4f; late_ticks = %d; };\n"
		"limits = { force_N = %.1f; pose_age_ms = 100.0; };\n",
		force->tissue, gain, force->rest, loop.mass_kg, damping_N_s_mm,
		loop.late_ticks, FORCE_N);
	memory_file_written(&file);
	*scene = incise_scene_load(file.path, NULL, err);
	if (*scene)
		plan = incise_plan_new_fed(*scene, &tracker, err);
	/* The path of a file in memory differs from run to run. */
	if (!plan && !strncmp(err->text, file.path, n))
		memmove(err->text, err->text + n + 2, strlen(err->text + n + 1));
	fclose(file.file);
	return plan;
}

/* Ways to lean: where, and how. The guided ones are of a plane. */
static const struct {
	bool free, beside, held;
	double askew, along_mm_s;
} ways[] = {{.along_mm_s = 0},
	    {.along_mm_s = 15},
	    {.free = true},
	    {.free = true, .held = true, .askew = 0.25},
	    {.free = true, .held = true, .beside = true}};

/* A light hand, along the skin. */
static const struct closed_loop_hand hand = {0.14, 0.0016, 0.034};

/* The widest swing of all leans, and the lean. */
struct lean_end {
	double swing_mm, shaken_mm; /* shaken: by noise */
	struct closed_loop loop;
};

/* Lean with so many forces in each way, or until the first that swings. The swing is NaN where all
 * runs left the surface. */
static void lean_all(struct incise_plan *plan, const struct lean_case *lean, int sizes,
		     bool first, struct lean_end *most)
{
	struct incise_touch place[2];
	struct closed_loop_end end;
	double from_mm[3], shaken_mm;
	int run = 0;

	*most = (struct lean_end){.swing_mm = NAN};
	incise_plan_top(plan, &place[0]);
	v3_copy(from_mm, place[0].point_mm);
	v3_add(from_mm, from_mm, 4, (const double[3]){1, 1, -0.5});
	incise_surface_nearest(incise_plan_surface(plan), from_mm, &place[1]);
	if (forces[lean->force].inserts)
		incise_plan_set_tool(plan, INCISE_TOOL_TUBE);
	for (int i = 0; i < N(ways) * sizes; i++) {
		const struct incise_touch *at = &place[ways[i % N(ways)].beside];
		struct closed_loop loop = lean->loop;

		if (!ways[i % N(ways)].free && lean->shape)
			continue;
		loop.run_s = RUN_S;
		loop.lean_N = 0.95 * FORCE_N * (i / N(ways) + 1) / sizes;
		loop.noise_mm = i / N(ways) % 2 ? NOISE_MM : 0;
		loop.along_mm_s = ways[i % N(ways)].along_mm_s;
		loop.free = ways[i % N(ways)].free;
		loop.askew = ways[i % N(ways)].askew;
		if (ways[i % N(ways)].held)
			loop.hand = hand;
		v3_copy(loop.normal, at->normal);
		if (loop.free)
			v3_copy(loop.place_mm, at->point_mm);
		if (!closed_loop_run(plan, &loop, run++, &end))
			cli_fail("a plan does not take a tick");
		shaken_mm = end.shaken_mm;
		loop.run_s = LONG_S;
		if (!end.left && end.swing_mm > CLOSED_LOOP_SWING_MM)
			closed_loop_run(plan, &loop, run++, &end);
		if (end.left)
			continue;
		if (loop.noise_mm > 0)
			most->shaken_mm = fmax(most->shaken_mm, shaken_mm);
		/* Also for the first run. */
		if (end.swing_mm <= most->swing_mm)
			continue;
		most->swing_mm = end.swing_mm;
		most->loop = loop;
		if (first && end.swing_mm > CLOSED_LOOP_SWING_MM)
			return;
	}
}

struct rest_row {
	struct lean_case is;
	const char *surface, *force;
	double latency_ms;

	const char *
		verdict; /* "accepted": with the gain that the refusal names; "refused" */
	char why[500];	 /* of the refusal */
	double gain, margin, plan_s;
	struct lean_end end; /* of the widest swing; NaN: not run */
	double twice_mm;
	bool rests, rests_twice;
};

#define CASES_MAX 1000
static struct rest_row cases[CASES_MAX];
static int n_cases, sizes;

static const struct bench_table stability_rest_table = {
	.key = "rest",
	.row_bytes = sizeof(struct rest_row),
	.columns = {COLUMN(rest_row, "surface", surface),
		    COLUMN(rest_row, "force", force),
		    COLUMN(rest_row, "mass_kg", is.loop.mass_kg),
		    COLUMN(rest_row, "damping_N_s_mm", is.loop.damping_N_s_mm),
		    COLUMN(rest_row, "tracker_hz", is.loop.tracker_hz),
		    COLUMN(rest_row, "latency_ms", latency_ms),
		    COLUMN(rest_row, "late_ticks", is.loop.late_ticks),
		    COLUMN(rest_row, "verdict", verdict),
		    COLUMN(rest_row, "why", why),
		    COLUMN(rest_row, "gain", gain),
		    COLUMN(rest_row, "margin", margin),
		    COLUMN(rest_row, "plan_s", plan_s),
		    COLUMN(rest_row, "rests", rests),
		    COLUMN(rest_row, "swing_mm", end.swing_mm),
		    COLUMN(rest_row, "lean_N", end.loop.lean_N),
		    COLUMN(rest_row, "along_mm_s", end.loop.along_mm_s),
		    COLUMN(rest_row, "free", end.loop.free),
		    COLUMN(rest_row, "askew", end.loop.askew),
		    COLUMN(rest_row, "twice_mm", twice_mm),
		    COLUMN(rest_row, "rests_twice", rests_twice),
		    COLUMN(rest_row, "shaken_mm", end.shaken_mm)},
};

/* Swing with a gain, as if it were accepted. */
static double lean_forced(struct rest_row *row, double gain)
{
	struct incise_error err = {0};
	struct lean_end end = {.swing_mm = NAN};
	struct incise_scene *scene;
	struct incise_plan *plan = lean_plan(&row->is, gain, DAMPED_N_s_mm, &scene, &err);

	if (plan)
		lean_all(plan, &row->is, sizes, true, &end);
	incise_plan_free(plan);
	incise_scene_free(scene);
	return end.swing_mm;
}

static void try_case(struct rest_row *row)
{
	static const char words[] = "set tissue.gain to at most ";
	double damping_N_s_mm = row->is.loop.damping_N_s_mm, begin = stopwatch_ns();
	struct incise_error err = {0};
	struct incise_plan_stability s;
	struct incise_scene *scene;
	struct incise_plan *plan =
		lean_plan(&row->is, MUCH, damping_N_s_mm, &scene, &err);
	const char *advice = strstr(err.text, words);

	row->gain = MUCH;
	row->margin = row->twice_mm = row->end.swing_mm = NAN;
	row->plan_s = (stopwatch_ns() - begin) * 1e-9;
	snprintf(row->why, sizeof(row->why), "%s", err.text);
	if (advice) {
		incise_scene_free(scene);
		row->gain = atof(advice + strlen(words));
		plan = lean_plan(&row->is, row->gain, damping_N_s_mm, &scene, &err);
	}
	row->verdict = plan ? "accepted" : "refused";
	if (plan) {
		incise_plan_stability(plan, &s);
		row->margin = s.weakest.margin;
		lean_all(plan, &row->is, sizes, false, &row->end);
	}
	if (advice)
		row->twice_mm = lean_forced(row, TWICE * row->gain);
	row->rests = !(row->end.swing_mm > CLOSED_LOOP_SWING_MM);
	row->rests_twice = row->twice_mm <= CLOSED_LOOP_SWING_MM;
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static atomic_int next_case, tried;

static void *try_cases(void *nothing)
{
	int i;

	while (i = atomic_fetch_add(&next_case, 1), i < n_cases && !cli_stop) {
		try_case(&cases[i]);
		atomic_fetch_add(&tried, 1);
	}
	return nothing;
}

/* kg, N s/mm, Hz, s, ticks. */
static const struct closed_loop devices[] = {
	{0.05, 0.01, 120, 4.2e-3, .late_ticks = 0},
	{0.05, 0.05, 1000, 20e-3, .late_ticks = 0},
	{0.03, 0.005, 240, 4.2e-3, .late_ticks = 2},
	{0.1, 0.02, 60, 4.2e-3, .late_ticks = 5},
	{0.2, 0.05, 500, 1e-3, .late_ticks = 1},
	{0.1, 0.01, 1000, 1e-3, .late_ticks = 0},
};

/* Quick: each force once, on one surface of all in turn. */
static void add_cases(const struct bench_run *run)
{
	make_files();
	given = run->n_operands ? run->operands[0] : NULL;
	sizes = run->quick ? 4 : 10;
	for (int f = 0; f < N(forces) - !given; f++)
		for (int s = 0; s < N(shapes); s++)
			for (int d = 0; d < (run->quick ? 1 : N(devices)); d++) {
				struct rest_row *row = &cases[n_cases];

				if (run->quick && 2 * f % N(shapes) != s)
					continue;
				n_cases++;
				row->is = (struct lean_case){s, f, devices[d]};
				row->surface = shapes[s][0];
				row->force = forces[f].name;
				row->latency_ms = 1e3 * devices[d].latency_s;
			}
}

static void measure_stability_rest(const struct bench_run *run)
{
	pthread_t thread[64];
	long n = sysconf(_SC_NPROCESSORS_ONLN);

	add_cases(run);
	n = n < 1 ? 1 : n > N(thread) ? N(thread) : n;
	for (int i = 0; i < n; i++)
		if (pthread_create(&thread[i], NULL, try_cases, NULL))
			cli_fail("no thread for the cases");
	while (atomic_load(&tried) < n_cases && !cli_stop) {
		cli_progress("rest: %d of %d", atomic_load(&tried), n_cases);
		usleep(100000);
	}
	for (int i = 0; i < n; i++)
		pthread_join(thread[i], NULL);
	if (cli_stop)
		cli_fail("interrupted");
}

/* --- report --- */

/* Cases of a kind: of a surface and a force. */
struct sum {
	const char *surface, *force;
	int cases, accepted, swing, twice, rest_twice, failures;
	double widest_mm, plan_s; /* of the accepted; the longest */
};

static const struct bench_table sum_table = {
	.key = "rest_sums",
	.row_bytes = sizeof(struct sum),
	.columns = {COLUMN(sum, "surface", surface), COLUMN(sum, "force", force),
		    COLUMN(sum, "cases", cases), COLUMN(sum, "accepted", accepted),
		    COLUMN(sum, "swing", swing), COLUMN(sum, "widest_mm", widest_mm),
		    COLUMN(sum, "twice", twice), COLUMN(sum, "rest_twice", rest_twice),
		    COLUMN(sum, "plan_s", plan_s)},
};

/* The worst first. */
static int failure(const struct rest_row *row)
{
	return row->verdict[0] != 'a' || !row->rests ? 2 : row->rests_twice;
}

static int by_failure(const void *a, const void *b)
{
	return failure(b) - failure(a);
}

static void add_to(struct sum *sum, const struct rest_row *row)
{
	bool accepted = row->verdict[0] == 'a';

	sum->surface = row->surface;
	sum->force = row->force;
	sum->cases++;
	sum->accepted += accepted;
	sum->swing += accepted && !row->rests;
	if (accepted)
		sum->widest_mm = fmax(sum->widest_mm, row->end.swing_mm);
	sum->twice += !isnan(row->twice_mm);
	sum->rest_twice += row->rests_twice;
	sum->plan_s = fmax(sum->plan_s, row->plan_s);
	sum->failures =
		1000 * (sum->swing + sum->cases - sum->accepted) + sum->rest_twice;
}

static int by_failures(const void *a, const void *b)
{
	return ((const struct sum *)b)->failures - ((const struct sum *)a)->failures;
}

void stability_rest(struct bench_run *run)
{
	static struct sum sums[N(shapes) * N(forces)];
	struct sum all = {.widest_mm = NAN};
	double swing, accepted, early;
	int n = 0;

	measure_stability_rest(run);
	cli_progress_end();
	for (int i = 0; i < n_cases; i++) {
		if (!i || cases[i].surface != cases[i - 1].surface ||
		    cases[i].force != cases[i - 1].force)
			sums[n++].widest_mm = NAN;
		add_to(&sums[n - 1], &cases[i]);
		add_to(&all, &cases[i]);
	}
	qsort(sums, (size_t)n, sizeof(*sums), by_failures);
	bench_rows(run, &sum_table, sums, n);
	qsort(cases, (size_t)n_cases, sizeof(*cases), by_failure);
	bench_rows(run, &stability_rest_table, cases, n_cases);
	swing = all.swing;
	accepted = all.accepted;
	early = all.twice ? (double)all.rest_twice / all.twice : 0;
	metrics_add(run->metrics, METRIC_EXACT, &swing, "1", "accepted cases that swing");
	metrics_add(run->metrics, METRIC_EXACT, &early, "1",
		    "refused plans that would rest twice as strong");
	metrics_more_is_better(metrics_add(run->metrics, METRIC_EXACT, &accepted, "1",
					   "cases accepted with the gain that is named"));
	if (all.swing > 0)
		bench_fail(run,
			   "rest: %d of %d accepted cases oscillate: please report it",
			   all.swing, all.accepted);
}
