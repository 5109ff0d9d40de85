// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Walls of 10 N/m to 1 GN/m; see stiff_sweep.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../../lib/control/guard.h"
#include <incise/plan.h>
#include "../../lib/control/plant.h"
#include "bench_device.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "stiff_sweep.h"

/* The device of a scene that describes none. */
#define DAMPING_N_s_mm 0.01
#define LIMIT_N 4.0
#define SLEW_N_s 100000.0 /* the most there is: less would itself be a lag */
#define PRESS_N 1.0
#define BEGIN_mm 1.0
#define TICKS 12000
#define TRACKER_HZ 120
#define LATENCY_S 4.2e-3
/* A description under which the softest of walls to beyond 1e6 N/m is stable: the device
 * is not so. That is how a scene is forced. */
#define LIE "damping_N_s_mm = 1.0; delay_ticks = 0;"
/* The most that a scene may say, with its gain. */
#define SCENE_MAX_N_mm 10000.0
/* What is still, of the millimetre that it fell and the way that it sinks in. */
#define STILL 1e-3
#define GONE_mm 1e4

/* One run of the device; the force is held from tick to tick. */
struct run {
	struct stiff_row *row;
	struct incise_plant plant;
	double low[4], high[4]; /* of each quarter */
	int k;
};

static void begin(struct run *run, struct stiff_row *row)
{
	*run = (struct run){.row = row,
			    .plant = {.mass_kg = DEVICE_KG,
				      .damping_N_s_mm = DAMPING_N_s_mm,
				      .position_mm = BEGIN_mm}};
	for (int q = 0; q < 4; q++) {
		run->low[q] = INFINITY;
		run->high[q] = -INFINITY;
	}
}

static void note(struct run *run, double force_N)
{
	double x = run->plant.position_mm;
	int q = 4 * run->k / TICKS;

	if (!isfinite(x) || !isfinite(force_N))
		run->row->not_finite++;
	run->low[q] = fmin(run->low[q], x);
	run->high[q] = fmax(run->high[q], x);
	run->row->largest_N = fmax(run->row->largest_N, fabs(force_N));
	run->row->largest_mm = fmax(run->row->largest_mm, fabs(x));
}

/* May it bounce for ever, but not higher and higher. */
static void judge(struct run *run)
{
	struct stiff_row *row = run->row;
	double second = run->high[1] - run->low[1];

	row->late_mm = run->high[3] - run->low[3];
	row->bounded = run->k == TICKS && !row->not_finite && row->largest_N <= LIMIT_N &&
		       (row->late_mm < 1.25 * second || row->late_mm < BEGIN_mm);
	if (!row->bounded)
		snprintf(row->failed, sizeof(row->failed), "not bounded");
	else if (row->accepted &&
		 !(row->late_mm < STILL * (BEGIN_mm + PRESS_N / row->K_N_mm)))
		snprintf(row->failed, sizeof(row->failed),
			 "accepted, and not still: it moves by %.3g mm", row->late_mm);
	row->missed = *row->failed;
}

/* ---- the wall alone ---- */

static void run_wall(struct stiff_row *row)
{
	const struct incise_haptic_device device = {.mass_kg = DEVICE_KG,
						    .damping_N_s_mm = DAMPING_N_s_mm,
						    .period_s = PERIOD_S};
	struct incise_guard guard;
	double was = BEGIN_mm;
	struct run run;

	row->limit_N_mm = incise_stability_limit(&device, 0);
	row->accepted = row->K_N_mm <= row->limit_N_mm;
	/* As plans do: the credit is what the tissue can have stored. */
	incise_guard_init(&guard, DEVICE_KG, PERIOD_S,
			  row->guard ? LIMIT_N * LIMIT_N / row->K_N_mm / 2 : 0);
	begin(&run, row);
	for (; run.k < TICKS && fabs(run.plant.position_mm) < GONE_mm; run.k++) {
		double x = run.plant.position_mm, at[3] = {x},
		       v[3] = {(x - was) / PERIOD_S};
		double force[3] = {x < 0 ? -row->K_N_mm * x : 0};

		incise_guard_apply(&guard, at, v, force);
		force[0] = fmax(-LIMIT_N, fmin(LIMIT_N, force[0]));
		incise_guard_sent(&guard, force);
		was = x;
		note(&run, force[0]);
		incise_plant_step(&run.plant, force[0] - PRESS_N, PERIOD_S);
	}
	judge(&run);
}

/* ---- a whole plan ---- */

static struct incise_plan *make_plan(const struct stiff_row *row, const char *device,
				     struct incise_scene **scene,
				     struct incise_error *err)
{
	struct memory_file file = memory_file_begin("scene");
	double gain = row->K_N_mm > 1000 ? 10 : 1;
	struct incise_plan *plan = NULL;

	fprintf(file.file,
		"arithmetic = \"double\";\ntissue = { gain = %.1f; reaction_N_mm = %.17e; "
		"leave_mm = 0.0; };\neffects = { guard = %s; };\ndevice = { %s };\n"
		"limits = { force_N = %.17e; slew_N_s = %.17e; start_N = 100.0; "
		"ramp_ms = 1.0; };\n",
		gain, row->K_N_mm / gain, row->guard ? "true" : "false", device, LIMIT_N,
		SLEW_N_s);
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
	const struct stiff_row soft = {.K_N_mm = 0.01};
	struct incise_plan_stability stability;
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = make_plan(&soft, "", &scene, &err);

	if (!plan)
		cli_fail_with(&err);
	incise_plan_stability(plan, &stability);
	incise_plan_free(plan);
	incise_scene_free(scene);
	return stability.limit_N_mm;
}

/* From one tick to the next, by way of the poses that are taken in between. */
static void go_on(struct run *run, struct incise_plan *plan, int *poses, int *fed,
		  double taken[2], double force_N)
{
	double from = run->k * PERIOD_S, to = from + PERIOD_S, pose;

	while ((pose = (double)*poses / TRACKER_HZ) < to) {
		incise_plant_step(&run->plant, force_N, fmax(0, pose - from));
		from = fmax(from, pose);
		taken[(*poses)++ % 2] = run->plant.position_mm;
	}
	incise_plant_step(&run->plant, force_N, to - from);
	/* Those that have arrived by the next tick. */
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

static void run_plan(struct stiff_row *row)
{
	struct incise_error err = {0}, forced = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = make_plan(row, "", &scene, &err);
	double taken[2] = {0}, force_N = 0;
	int poses = 0, fed = 0;
	struct run run;

	row->limit_N_mm = plan_limit();
	row->accepted = plan;
	if (!plan) {
		incise_scene_free(scene);
		plan = make_plan(row, LIE, &scene, &forced);
	}
	if (!plan) {
		const char *text = strchr(forced.text, ' ');

		snprintf(row->failed, sizeof(row->failed), "%.*s",
			 (int)strcspn(text ? text + 1 : forced.text, ";"),
			 text ? text + 1 : forced.text);
		incise_scene_free(scene);
		return;
	}
	begin(&run, row);
	for (; run.k < TICKS && fabs(run.plant.position_mm) < GONE_mm; run.k++) {
		struct incise_tick tick;

		go_on(&run, plan, &poses, &fed, taken, force_N - PRESS_N);
		if (incise_plan_tick(plan, llrint((run.k + 1) * PERIOD_S * 1e9), &tick))
			row->not_finite++;
		force_N = tick.command_N[2];
		note(&run, force_N);
	}
	judge(&run);
	if (row->accepted != (row->K_N_mm <= row->limit_N_mm)) {
		snprintf(row->failed, sizeof(row->failed),
			 "%s, and theory says otherwise",
			 row->accepted ? "accepted" : "refused");
		row->missed = true;
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

void stiff_sweep(struct stiff_sweep *sweep, bool quick)
{
	for (int path = 0; path < STIFF_PATHS; path++)
		for (int guard = 0; guard < 2; guard++)
			/* 10 N/m to 1e9, and so in N/mm. */
			for (int k = 0; k <= 24 && !cli_stop; k += quick ? 6 : 1) {
				struct stiff_row *row = &sweep->row[sweep->n++];

				*row = (struct stiff_row){.path = path,
							  .guard = guard,
							  .K_N_mm =
								  pow(10, -2 + k / 3.0)};
				cli_progress("stiff: %g N/m", row->K_N_mm * 1e3);
				(path == STIFF_PLAN ? run_plan : run_wall)(row);
			}
}

int stiff_sweep_missed(const struct stiff_sweep *sweep)
{
	int missed = 0;

	for (int i = 0; i < sweep->n; i++)
		missed += sweep->row[i].missed;
	return missed;
}
