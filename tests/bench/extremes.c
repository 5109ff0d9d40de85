// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * properties of the library under any input (tests/extremes), and walls of
 * 10 N/m to 1 GN/m: whether a scene with one is accepted, and what a device makes of it all the
 * same, behind the limit of force.
 *
 *   hand leans ──▶ ○ device ──▶ │ wall ──▶ limit ──▶ device       closed_loop.h
 *
 * The whole plan is fed by a tracker of 120 Hz that is 4.2 ms late.
 */
#include <stdio.h>
#include <string.h>
#include <incise/plan.h>
#include "../extremes/extremes.h"
#include "../../tools/cli/file.h"
#include "../../tools/cli/scene_argument.h"
#include "../../tools/bench/closed_loop.h"
#include "../wall_limit.h"
#include "program.h"

/* --- properties --- */

#define ROWS_MAX 64
#define QUICK_PART 20 /* a look tries one of so many cases */

static const struct bench_table properties = {
	.key = "rows",
	.row_bytes = sizeof(struct extremes_row),
	.columns =
		{
			COLUMN(extremes_row, "name", name),
			COLUMN(extremes_row, "what", what),
			COLUMN(extremes_row, "tried", tried),
			COLUMN(extremes_row, "held", held),
			COLUMN(extremes_row, "refused", refused),
			COLUMN(extremes_row, "wrong", wrong),
			COLUMN(extremes_row, "failed", failed),
		},
};

static int try_all(const struct extremes_setup *setup, struct extremes_row *rows)
{
	static const struct property *const tables[] = {
		model_properties,   fixed_properties,  surface_properties,
		control_properties, motion_properties, plan_properties,
		wall_properties,    device_properties, file_properties};
	int n = 0;

	for (int i = 0; i < N(tables); i++)
		for (const struct property *p = tables[i]; p->name; p++) {
			if (p->for_tests_only)
				continue;
			if (n == ROWS_MAX)
				cli_fail("extremes: more than %d rows", ROWS_MAX);
			cli_progress("extremes: %s", p->name);
			extremes_try(p, setup, &rows[n++]);
		}
	return n;
}

static void report_properties(struct bench_run *run, const struct extremes_row *rows,
			      int n)
{
	const char *first = NULL;
	long wrong = 0;

	bench_rows(run, &properties, rows, n);
	for (int i = 0; i < n; i++) {
		const struct extremes_row *r = &rows[i];

		metrics_add(run->metrics, METRIC_EXACT, &(double){(double)r->wrong},
			    "cases", "%s wrong", r->name);
		wrong += r->wrong;
		if (r->wrong && !first)
			first = r->name;
	}
	if (wrong)
		bench_fail(run,
			   "%ld cases are wrong, the first in %s: a fault of "
			   "incise, please report it with the line above",
			   wrong, first);
}

/* --- stiff walls --- */

#define WALLS_MAX 25

struct wall {
	double K_N_mm;
	double limit_N_mm;	      /* by theory */
	bool accepted;		      /* as it is; else it was forced */
	double largest_N, largest_mm; /* NaN: it was not run */
	double late_mm;		      /* from one end to the other, in the last quarter */
	bool bounded;
	json_t *bounded_json;
	char failed[160]; /* why it was not run, or what is not as it must be */
	bool missed;	  /* the latter */
};

/* The device of a scene that describes none. */
static const struct closed_loop loop = {
	.mass_kg = 0.05,
	.damping_N_s_mm = 0.01,
	.tracker_hz = 120,
	.latency_s = 4.2e-3,
	.lean_N = 1,
	.run_s = 12,
};
#define LIMIT_N 4.0
#define SLEW_N_s 100000.0 /* the most there is: less would itself be a lag */
#define BOUNCE_mm 1.0
/* A scene is forced by a description under which walls up to beyond 1e6 N/m are stable: the
 * device is not like that. */
#define FORCED_DEVICE "damping_N_s_mm = 1.0; delay_ticks = 0;"
#define STILL 1e-3 /* of the half millimetre that it fell and the way that it sinks in */

/* It may bounce for ever, but not higher and higher. */
static void judge(struct wall *wall, const struct closed_loop_end *end)
{
	wall->largest_N = end->largest_N;
	wall->largest_mm = end->largest_mm;
	wall->late_mm = end->moved_mm;
	wall->bounded =
		isfinite(end->depth_mm + end->moved_mm) && wall->largest_N <= LIMIT_N &&
		(wall->late_mm < 1.25 * end->earlier_mm || wall->late_mm < BOUNCE_mm);
	if (!wall->bounded)
		snprintf(wall->failed, sizeof(wall->failed), "not bounded");
	else if (wall->accepted &&
		 !(wall->late_mm < STILL * (0.5 + loop.lean_N / wall->K_N_mm)))
		snprintf(wall->failed, sizeof(wall->failed),
			 "accepted, but not at rest: it moves by %.3g mm", wall->late_mm);
	else if (wall->accepted != (wall->K_N_mm <= wall->limit_N_mm))
		snprintf(wall->failed, sizeof(wall->failed),
			 "%s, in contradiction to theory",
			 wall->accepted ? "accepted" : "refused");
	wall->missed = *wall->failed;
}

static struct incise_plan *make_plan(const struct wall *wall, const char *device,
				     struct incise_scene **scene,
				     struct incise_error *err)
{
	struct memory_file file = memory_file_begin("scene");
	double gain = wall->K_N_mm > 1000 ? 10 : 1;
	struct incise_plan *plan = NULL;

	fprintf(file.file,
		"arithmetic = \"double\";\ntissue = { gain = %.1f; reaction_N_mm = %.17e; "
		"leave_mm = 0.0; };\ndevice = { %s };\n"
		"limits = { force_N = %.17e; slew_N_s = %.17e; start_N = 100.0; "
		"ramp_ms = 1.0; };\n",
		gain, wall->K_N_mm / gain, device, LIMIT_N, SLEW_N_s);
	memory_file_written(&file);
	*scene = incise_scene_load(file.path, NULL, err);
	if (*scene)
		plan = incise_plan_new(*scene, NULL, err);
	fclose(file.file);
	return plan;
}

/* By the loop's eigenvalues. */
static double theory_limit(void)
{
	const struct incise_haptic_device device = {.mass_kg = loop.mass_kg,
						    .damping_N_s_mm = loop.damping_N_s_mm,
						    .period_s = 1e-3};
	const struct incise_tracker_info tracker = closed_loop_tracker(&loop);
	struct incise_predict predict;

	incise_predict_init(&predict, &tracker, 0);
	return wall_limit(&device, &predict, 0, 0);
}

static void press(struct wall *wall)
{
	struct incise_error err = {0}, forced = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = make_plan(wall, "", &scene, &err);
	struct closed_loop_end end;
	const char *text;

	wall->limit_N_mm = theory_limit();
	wall->accepted = plan;
	if (!plan) {
		incise_scene_free(scene);
		plan = make_plan(wall, FORCED_DEVICE, &scene, &forced);
	}
	if (plan && closed_loop_run(plan, &loop, 0, &end)) {
		judge(wall, &end);
	} else if (plan) {
		snprintf(wall->failed, sizeof(wall->failed), "it does not take a tick");
		wall->missed = true;
	} else {
		text = strchr(forced.text, ' ');
		text = text ? text + 1 : forced.text;
		snprintf(wall->failed, sizeof(wall->failed), "%.*s",
			 (int)strcspn(text, ";"), text);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* From 10 N/m to 1e9, and so in N/mm. Returns how many. */
static int press_all(struct wall *walls, bool quick)
{
	int n = 0;

	for (int k = 0; k <= 24 && !cli_stop; k += quick ? 6 : 1) {
		struct wall *wall = &walls[n++];

		*wall = (struct wall){.K_N_mm = pow(10, -2 + k / 3.0),
				      .largest_N = NAN,
				      .largest_mm = NAN,
				      .late_mm = NAN};
		cli_progress("stiff: %g N/m", wall->K_N_mm * 1e3);
		press(wall);
	}
	return n;
}

static const struct bench_table stiff = {
	.key = "stiff",
	.row_bytes = sizeof(struct wall),
	.columns =
		{
			COLUMN(wall, "K_N_m", K_N_mm, .scale = 1e3),
			COLUMN(wall, "theory_limit_N_m", limit_N_mm, .scale = 1e3),
			COLUMN(wall, "accepted", accepted),
			COLUMN(wall, "largest_N", largest_N),
			COLUMN(wall, "largest_mm", largest_mm),
			COLUMN(wall, "late_mm", late_mm),
			COLUMN(wall, "bounded", bounded_json),
			COLUMN(wall, "failed", failed),
		},
	.metrics = {METRIC(EXACT, wall, largest_mm, "mm",
			   "plan, {K_N_m:%.4g} N/m, largest", "largest_mm!=nan")},
};

static void report_walls(struct bench_run *run, struct wall *walls, int n)
{
	int missed = 0;

	for (int i = 0; i < n; i++) {
		missed += walls[i].missed;
		if (!isnan(walls[i].largest_mm))
			walls[i].bounded_json = json_boolean(walls[i].bounded);
	}
	bench_rows(run, &stiff, walls, n);
	if (missed)
		bench_fail(run, "%d walls contradict theory: see 'failed'", missed);
}

static void run_extremes(struct bench_run *run)
{
	struct extremes_row *rows = cli_alloc(ROWS_MAX, sizeof(*rows));
	struct wall *walls = cli_alloc(WALLS_MAX, sizeof(*walls));
	const struct extremes_setup setup = {.seed = run->seed ? (uint64_t)run->seed : 1,
					     .part = run->quick ? QUICK_PART : 1,
					     .scenes = scene_argument_shipped()};
	int n = try_all(&setup, rows), n_walls = press_all(walls, run->quick);

	if (cli_stop)
		cli_fail("interrupted");
	bench_value(run, "seed", json_integer((json_int_t)setup.seed));
	report_properties(run, rows, n);
	report_walls(run, walls, n_walls);
}

const struct bench bench_program = {
	.name = "extremes",
	.summary = "extreme numbers and corrupt bytes at each interface;\n"
		   "walls of 10 N/m to 1 GN/m",
	.takes_seed = true,
	.run = run_extremes,
};
