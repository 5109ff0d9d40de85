// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * properties of the library under any input (tests/extremes), and walls of
 * 10 N/m to 1 GN/m: whether a scene with one is accepted, and what a device makes of it all the
 * same, behind the limit of force.
 *
 *   pressed by a weight ──▶ ○ device ──▶ │ wall ──▶ limit ──▶ device
 *
 * A wall is tried in two ways: by a whole plan, fed by a tracker of 120 Hz that is 4.2 ms late;
 * and alone, with the position of the tick, as by an encoder.
 */
#include <stdio.h>
#include <string.h>
#include <incise/plan.h>
#include "../../lib/control/plant.h"
#include <incise/stability.h>
#include "../extremes/extremes.h"
#include "../../tools/cli/file.h"
#include "../../tools/cli/scene_argument.h"
#include "../../tools/bench/stability.h"
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

#define WALLS_MAX 50 /* by path and stiffness */

enum path { PATH_PLAN, PATH_WALL, PATHS };

struct wall {
	const char *path;
	double K_N_mm;
	double limit_N_mm;	      /* by theory */
	bool accepted;		      /* as it is; else it was forced */
	double largest_N, largest_mm; /* NaN: it was not run */
	double late_mm;		      /* from one end to the other, in the last quarter */
	long not_finite;
	bool bounded;
	json_t *bounded_json;
	char failed[160]; /* why it was not run, or what is not as it must be */
	bool missed;	  /* the latter */
};

/* The device of a scene that describes none. */
#define DAMPING_N_s_mm 0.01
#define LIMIT_N 4.0
#define SLEW_N_s 100000.0 /* the most there is: less would itself be a lag */
#define PRESS_N 1.0
#define BEGIN_mm 1.0
#define TICKS 12000
#define TRACKER_HZ 120
#define LATENCY_S 4.2e-3
/* A scene is forced by a description under which walls up to beyond 1e6 N/m are stable: the
 * device is not like that. */
#define FORCED_DEVICE "damping_N_s_mm = 1.0; delay_ticks = 0;"
#define STILL 1e-3 /* of the millimetre that it fell and the way that it sinks in */
#define GONE_mm 1e4

/* One run of the device; the force is held from tick to tick. */
struct run {
	struct wall *wall;
	struct incise_plant plant;
	double low[4], high[4]; /* of each quarter */
	int k;
};

static struct run start_run(struct wall *wall)
{
	return (struct run){
		.wall = wall,
		.plant = {.mass_kg = DEVICE_KG,
			  .damping_N_s_mm = DAMPING_N_s_mm,
			  .position_mm = BEGIN_mm},
		.low = {INFINITY, INFINITY, INFINITY, INFINITY},
		.high = {-INFINITY, -INFINITY, -INFINITY, -INFINITY},
	};
}

/* Whether the next tick is to come. */
static bool goes_on(const struct run *run)
{
	return run->k < TICKS && fabs(run->plant.position_mm) < GONE_mm;
}

static void note(struct run *run, double force_N)
{
	double x = run->plant.position_mm;
	int q = 4 * run->k / TICKS;

	if (!isfinite(x) || !isfinite(force_N))
		run->wall->not_finite++;
	run->low[q] = fmin(run->low[q], x);
	run->high[q] = fmax(run->high[q], x);
	run->wall->largest_N = fmax(run->wall->largest_N, fabs(force_N));
	run->wall->largest_mm = fmax(run->wall->largest_mm, fabs(x));
}

/* It may bounce for ever, but not higher and higher. */
static void judge(struct run *run)
{
	struct wall *wall = run->wall;
	double second = run->high[1] - run->low[1];

	wall->late_mm = run->high[3] - run->low[3];
	wall->bounded = run->k == TICKS && !wall->not_finite &&
			wall->largest_N <= LIMIT_N &&
			(wall->late_mm < 1.25 * second || wall->late_mm < BEGIN_mm);
	if (!wall->bounded)
		snprintf(wall->failed, sizeof(wall->failed), "not bounded");
	else if (wall->accepted &&
		 !(wall->late_mm < STILL * (BEGIN_mm + PRESS_N / wall->K_N_mm)))
		snprintf(wall->failed, sizeof(wall->failed),
			 "accepted, but not at rest: it moves by %.3g mm", wall->late_mm);
	wall->missed = *wall->failed;
}

/* The wall alone. */
static void press_wall(struct wall *wall)
{
	const struct incise_haptic_device device = {.mass_kg = DEVICE_KG,
						    .damping_N_s_mm = DAMPING_N_s_mm,
						    .period_s = PERIOD_S};
	struct run run = start_run(wall);

	wall->limit_N_mm = incise_stability_limit(&device, 0);
	wall->accepted = wall->K_N_mm <= wall->limit_N_mm;
	for (; goes_on(&run); run.k++) {
		double x = run.plant.position_mm;
		double force_N = x < 0 ? fmin(LIMIT_N, -wall->K_N_mm * x) : 0;

		note(&run, force_N);
		incise_plant_step(&run.plant, force_N - PRESS_N, PERIOD_S);
	}
	judge(&run);
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

/* The limit is that of the device, whatever the wall is. */
static double plan_limit(void)
{
	const struct wall soft = {.K_N_mm = 0.01};
	struct incise_plan_stability stability;
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = cli_require(make_plan(&soft, "", &scene, &err), &err);

	incise_plan_stability(plan, &stability);
	incise_plan_free(plan);
	incise_scene_free(scene);
	return stability.limit_N_mm;
}

/* From one tick to the next, with the poses that are taken in between. */
static void advance(struct run *run, struct incise_plan *plan, int *poses, int *fed,
		    double taken[2], double force_N)
{
	double from = run->k * PERIOD_S, to = from + PERIOD_S, pose;

	while ((pose = (double)*poses / TRACKER_HZ) < to) {
		incise_plant_step(&run->plant, force_N, fmax(0, pose - from));
		from = fmax(from, pose);
		taken[(*poses)++ % 2] = run->plant.position_mm;
	}
	incise_plant_step(&run->plant, force_N, to - from);
	/* Feed those that have arrived by the next tick. */
	while (*fed < *poses && (double)*fed / TRACKER_HZ + LATENCY_S <= to) {
		struct incise_tracker_sample s = {
			.t_ns = llrint(((double)*fed / TRACKER_HZ + LATENCY_S) * 1e9),
			.position_mm = {0, 0, taken[*fed % 2]},
			.quaternion = {1},
			.status = ' '};

		incise_plan_feed(plan, &s, 1);
		++*fed;
	}
}

/* A whole plan. */
static void press_plan(struct wall *wall)
{
	struct incise_error err = {0}, forced = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = make_plan(wall, "", &scene, &err);
	struct run run = start_run(wall);
	double taken[2] = {0}, force_N = 0;
	int poses = 0, fed = 0;

	wall->limit_N_mm = plan_limit();
	wall->accepted = plan;
	if (!plan) {
		incise_scene_free(scene);
		plan = make_plan(wall, FORCED_DEVICE, &scene, &forced);
	}
	if (!plan) {
		const char *text = strchr(forced.text, ' ');

		snprintf(wall->failed, sizeof(wall->failed), "%.*s",
			 (int)strcspn(text ? text + 1 : forced.text, ";"),
			 text ? text + 1 : forced.text);
		incise_scene_free(scene);
		return;
	}
	for (; goes_on(&run); run.k++) {
		struct incise_tick tick;

		advance(&run, plan, &poses, &fed, taken, force_N - PRESS_N);
		if (incise_plan_tick(plan, llrint((run.k + 1) * PERIOD_S * 1e9), &tick))
			wall->not_finite++;
		force_N = tick.command_N[2];
		note(&run, force_N);
	}
	judge(&run);
	if (wall->accepted != (wall->K_N_mm <= wall->limit_N_mm)) {
		snprintf(wall->failed, sizeof(wall->failed),
			 "%s, in contradiction to theory",
			 wall->accepted ? "accepted" : "refused");
		wall->missed = true;
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* From 10 N/m to 1e9, and so in N/mm. @return their number of each path */
static int press_all(struct wall *walls, bool quick)
{
	static const char *const paths[PATHS] = {"plan", "wall"};
	int n = 0;

	for (int path = 0; path < PATHS; path++)
		for (int k = 0; k <= 24 && !cli_stop; k += quick ? 6 : 1) {
			struct wall *wall = &walls[n++];

			*wall = (struct wall){.path = paths[path],
					      .K_N_mm = pow(10, -2 + k / 3.0),
					      .largest_N = NAN,
					      .largest_mm = NAN,
					      .late_mm = NAN};
			cli_progress("stiff: %g N/m", wall->K_N_mm * 1e3);
			(path == PATH_PLAN ? press_plan : press_wall)(wall);
		}
	return n / PATHS;
}

static const struct bench_table stiff = {
	.key = "stiff",
	.row_bytes = sizeof(struct wall),
	.columns =
		{
			COLUMN(wall, "path", path),
			COLUMN(wall, "K_N_m", K_N_mm, .scale = 1e3),
			COLUMN(wall, "theory_limit_N_m", limit_N_mm, .scale = 1e3),
			COLUMN(wall, "accepted", accepted),
			COLUMN(wall, "largest_N", largest_N),
			COLUMN(wall, "largest_mm", largest_mm),
			COLUMN(wall, "late_mm", late_mm),
			COLUMN(wall, "not_finite", not_finite),
			COLUMN(wall, "bounded", bounded_json),
			COLUMN(wall, "failed", failed),
		},
	.metrics = {METRIC(EXACT, wall, largest_mm, "mm",
			   "{path}, {K_N_m:%.4g} N/m, largest", "largest_mm!=nan")},
};

static void report_walls(struct bench_run *run, struct wall *walls, int each)
{
	int missed = 0;

	for (int i = 0; i < PATHS * each; i++) {
		missed += walls[i].missed;
		if (!isnan(walls[i].largest_mm))
			walls[i].bounded_json = json_boolean(walls[i].bounded);
	}
	bench_rows(run, &stiff, walls, PATHS * each);
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
	int n = try_all(&setup, rows), each = press_all(walls, run->quick);

	if (cli_stop)
		cli_fail("interrupted");
	bench_value(run, "seed", json_integer((json_int_t)setup.seed));
	report_properties(run, rows, n);
	report_walls(run, walls, each);
}

const struct bench bench_program = {
	.name = "extremes",
	.summary = "extreme numbers and corrupt bytes at each interface;\n"
		   "walls of 10 N/m to 1 GN/m",
	.takes_seed = true,
	.run = run_extremes,
};
