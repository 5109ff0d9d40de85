// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error of the force over the loop's rate; see bench_rate.h.
 *
 * A cut of the virtual surgeon into a plain wall, whose force is known at any time: K times
 * the depth of the blade, which the virtual rig tells. All forces are compared at 64 kHz:
 *
 *   exact       ___...---''''
 *   asked for   ____|''''|''''    held between ticks, from poses that are late and noisy
 *   rendered    ______.-'''.-'    what the actuator's spring does of it
 *               |    |    |       ticks; between them 8 … 256 points
 *
 * An ideal sample and hold is off by F' times the age of the sample, 0 … T, which is
 * rms F' · T/√3: no loop that does not predict is better.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/backend.h>
#include <incise/plan.h>
#include "bench_rate.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "../cli/file.h"
#include "../cli/tick_cost.h"
#include "../../lib/sim/sim.h"

/* Whole numbers of ns, and multiples of all rates. */
#define POINT_HZ 64000
#define QUICK_POINT_HZ 16000

/* Of the stroke's time that the cost of a tick is taken of. */
#define COST_S 20
#define QUICK_COST_S 2

static const int rates_hz[] = {250, 500, 1000, 2000, 4000, 8000};
#define RATES (int)(sizeof(rates_hz) / sizeof(*rates_hz))

static const struct series {
	const char *wall, *poses;
	double stiffness_N_mm, depth_mm; /* some 3 N */
	bool exact;			 /* a pose at each tick, without noise, at once */
} series[] = {
	{"wall", "tracker", 0.33, 10, false},
	{"wall", "exact", 0.33, 10, true},
	{"stiff", "exact", 1.5, 2, true},
};
#define SERIES (int)(sizeof(series) / sizeof(*series))

/* A tracker that says where the tip is now, once a tick: as an encoder would. */
struct exact_tracker {
	struct incise_tracker_ops ops;
	const struct incise_tracker_ops *before;
	struct incise_sim *sim;
	double rate_hz;
	uint64_t seq;
};

static struct exact_tracker *exact; /* of the run under way: ops have no context */

static int exact_read(struct incise_tracker *tracker,
		      struct incise_tracker_sample *samples, int n)
{
	struct incise_sim_truth truth;

	(void)tracker;
	if (n < 1)
		return 0;
	incise_sim_truth(exact->sim, &truth);
	*samples = (struct incise_tracker_sample){
		.t_ns = truth.t_ns, .seq = exact->seq++, .status = ' ', .station = 1};
	memcpy(samples->position_mm, truth.position_mm, sizeof(samples->position_mm));
	memcpy(samples->quaternion, truth.quaternion, sizeof(samples->quaternion));
	return 1;
}

static void exact_info(const struct incise_tracker *tracker,
		       struct incise_tracker_info *info)
{
	(void)tracker;
	*info = (struct incise_tracker_info){
		.name = "exact", .rate_hz = exact->rate_hz, .stations = 1};
}

/* Sums over the points of a cut. */
struct sums {
	double command2, rendered2, exact2, slope2;
	double command_max, rendered_max, before;
	int point_hz;
	uint64_t n;
};

static void add(struct sums *sums, double exact_N, double command_N, double rendered_N)
{
	double command = command_N - exact_N, rendered = rendered_N - exact_N;
	double slope = (exact_N - sums->before) * sums->point_hz;

	if (sums->n++)
		sums->slope2 += slope * slope;
	sums->before = exact_N;
	sums->exact2 += exact_N * exact_N;
	sums->command2 += command * command;
	sums->rendered2 += rendered * rendered;
	sums->command_max = fmax(sums->command_max, fabs(command));
	sums->rendered_max = fmax(sums->rendered_max, fabs(rendered));
}

static void finish(const struct sums *sums, struct rate_row *row)
{
	double n = (double)sums->n, all = sqrt(sums->exact2 / n);

	row->command.rms_N = sqrt(sums->command2 / n);
	row->command.max_N = sums->command_max;
	row->command.relative = row->command.rms_N / all;
	row->rendered.rms_N = sqrt(sums->rendered2 / n);
	row->rendered.max_N = sums->rendered_max;
	row->rendered.relative = row->rendered.rms_N / all;
	row->hold_N = sqrt(sums->slope2 / n) / row->rate_hz / sqrt(3);
}

/* Returns 0 or a negative errno of a tick. */
static int cut(struct incise_plan *plan, struct incise_rig *rig, int point_hz,
	       struct rate_row *row)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_sim *sim = incise_rig_sim(rig);
	int64_t start_ns = incise_clock_now(clock);
	int64_t point_ns = INCISE_NS_PER_S / point_hz;
	int64_t points = incise_sim_duration(sim) / point_ns;
	int every = (int)(point_hz / row->rate_hz);
	struct incise_tick tick = {0};
	struct sums sums = {.point_hz = point_hz};

	for (int64_t k = 1; k <= points; k++) {
		struct incise_stepper_status status;
		struct incise_sim_truth truth;
		int rc = 0;

		incise_clock_wait_until(clock, start_ns + k * point_ns);
		if (k % every == 0)
			rc = incise_plan_tick(plan, incise_clock_now(clock), &tick);
		if (!rc)
			rc = incise_stepper_status(incise_rig_stepper(rig), &status);
		if (rc)
			return rc;
		incise_sim_truth(sim, &truth);
		if (truth.cut >= 0)
			add(&sums, row->stiffness_N_mm * truth.depth_mm,
			    tick.command_N[2], status.force_N);
	}
	finish(&sums, row);
	return 0;
}

static void run_plan(struct incise_scene *scene, struct incise_rig *rig, int point_hz,
		     struct rate_row *row)
{
	struct incise_plan_stability stability;
	struct incise_error err = {0};
	struct incise_plan *plan = incise_plan_new(scene, rig, &err);
	const char *text;
	int rc;

	if (!plan) {
		/* The file's name says nothing here, nor how to mend it. */
		text = strchr(err.text, ' ');
		text = text ? text + 1 : err.text;
		snprintf(row->failed, sizeof(row->failed), "%.*s",
			 (int)strcspn(text, ";"), text);
		return;
	}
	incise_plan_stability(plan, &stability);
	row->limit_N_mm = stability.limit_N_mm;
	rc = cut(plan, rig, point_hz, row);
	if (rc)
		snprintf(row->failed, sizeof(row->failed), "a tick failed: %s",
			 strerror(-rc));
	incise_plan_free(plan);
}

static struct incise_scene *make_scene(const struct rate_row *row)
{
	struct memory_file file = memory_file_begin("scene");
	struct incise_error err = {0};
	struct incise_scene *scene;

	/* In double: the error of the loop is looked for, not that of the digits. */
	fprintf(file.file,
		"rate_hz = %.1f;\narithmetic = \"double\";\ntissue = { reaction_N_mm = %g; };\n",
		row->rate_hz, row->stiffness_N_mm);
	memory_file_written(&file);
	scene = incise_scene_load(file.path, NULL, &err);
	if (!scene)
		cli_fail_with(&err);
	fclose(file.file);
	return scene;
}

static void measure(const struct series *s, bool quick, struct rate_row *row)
{
	struct exact_tracker tracker = {.rate_hz = row->rate_hz};
	struct incise_error err = {0};
	struct incise_tracker_info info;
	struct incise_scene *scene = make_scene(row);
	struct incise_rig *rig;
	struct tick_cost cost;
	char spec[80];

	snprintf(spec, sizeof(spec), "sim:clock=simulated,depth_mm=%g,times=1",
		 s->depth_mm);
	rig = incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, &err);
	if (!rig)
		cli_fail_with(&err);
	if (s->exact) {
		tracker.before = incise_rig_tracker(rig)->ops;
		tracker.ops = *tracker.before;
		tracker.ops.read = exact_read;
		tracker.ops.info = exact_info;
		tracker.sim = incise_rig_sim(rig);
		exact = &tracker;
		incise_rig_tracker(rig)->ops = &tracker.ops;
	}
	incise_tracker_info(incise_rig_tracker(rig), &info);
	run_plan(scene, rig, quick ? QUICK_POINT_HZ : POINT_HZ, row);
	if (!*row->failed) {
		tick_cost(scene, &info, quick ? QUICK_COST_S : COST_S, &cost);
		row->tick_ns = cost.median;
		row->ns_per_s = cost.median * row->rate_hz;
	}
	if (s->exact)
		incise_rig_tracker(rig)->ops = tracker.before;
	incise_rig_close(rig);
	incise_scene_free(scene);
}

void bench_rate(bool quick, struct rates *rates)
{
	*rates = (struct rates){.series = SERIES, .rates = RATES};
	rates->row = calloc(SERIES * RATES, sizeof(*rates->row));
	if (!rates->row)
		cli_fail("no memory");
	for (int i = 0; i < SERIES * RATES && !cli_stop; i++) {
		const struct series *s = &series[i / RATES];
		struct rate_row *row = &rates->row[rates->n++];

		*row = (struct rate_row){
			.wall = s->wall,
			.poses = s->poses,
			.rate_hz = rates_hz[i % RATES],
			.stiffness_N_mm = s->stiffness_N_mm,
			.limit_N_mm = NAN,
			.command = {NAN, NAN, NAN},
			.rendered = {NAN, NAN, NAN},
			.hold_N = NAN,
			.tick_ns = NAN,
			.ns_per_s = NAN,
		};
		cli_progress("%s, %s poses, %g Hz", row->wall, row->poses, row->rate_hz);
		measure(s, quick, row);
	}
	cli_progress_end();
}

/* ---- report ---- */

static json_t *error_json(const struct rate_error *error)
{
	return json_pack("{so so so}", "rms_N", json_number(error->rms_N), "max_N",
			 json_number(error->max_N), "relative",
			 json_number(error->relative));
}

json_t *rates_json(const struct rates *rates)
{
	json_t *list = json_array();

	for (int i = 0; i < rates->n; i++) {
		const struct rate_row *row = &rates->row[i];

		json_array_append_new(
			list,
			json_pack("{ss ss so so so so so so so so so so so so so}",
				  "wall", row->wall, "poses", row->poses, "rate_hz",
				  json_number(row->rate_hz), "stiffness_N_mm",
				  json_number(row->stiffness_N_mm), "limit_N_mm",
				  json_number(row->limit_N_mm), "command",
				  error_json(&row->command), "rendered",
				  error_json(&row->rendered), "hold_N",
				  json_number(row->hold_N), "tick_ns",
				  json_number(row->tick_ns), "ns_per_s",
				  json_number(row->ns_per_s), "rms_N",
				  json_number(row->command.rms_N), "max_N",
				  json_number(row->command.max_N), "rendered_rms_N",
				  json_number(row->rendered.rms_N), "rendered_max_N",
				  json_number(row->rendered.max_N), "failed",
				  *row->failed ? json_text(row->failed) : json_null()));
	}
	return list;
}

void rates_figures(const struct rates *rates, json_t *figures)
{
	for (int i = 0; i < rates->n; i++) {
		const struct rate_row *row = &rates->row[i];

		if (row->rate_hz != 1000)
			continue;
		metrics_exact(figures, row->command.rms_N, "N",
			      "%s %s command rms at 1 kHz", row->wall, row->poses);
		metrics_exact(figures, row->rendered.rms_N, "N",
			      "%s %s rendered rms at 1 kHz", row->wall, row->poses);
		metrics_exact(figures, row->rendered.max_N, "N",
			      "%s %s rendered largest at 1 kHz", row->wall, row->poses);
	}
}

void rates_print(const struct rates *rates)
{
	printf("\nerror of the force over a cut, mN    asked for              rendered        "
	       "ideal\n%-6s %-8s %6s %8s %8s %6s %8s %8s %6s %8s %8s %9s\n",
	       "wall", "poses", "Hz", "rms", "max", "%", "rms", "max", "%", "hold",
	       "ns/tick", "us/s");
	for (int i = 0; i < rates->n; i++) {
		const struct rate_row *row = &rates->row[i];

		printf("%-6s %-8s %6g ", row->wall, row->poses, row->rate_hz);
		if (*row->failed)
			printf("%s\n", row->failed);
		else
			printf("%8.3f %8.2f %6.3f %8.2f %8.2f %6.3f %8.3f %8.0f %9.1f\n",
			       row->command.rms_N * 1e3, row->command.max_N * 1e3,
			       row->command.relative * 100, row->rendered.rms_N * 1e3,
			       row->rendered.max_N * 1e3, row->rendered.relative * 100,
			       row->hold_N * 1e3, row->tick_ns, row->ns_per_s * 1e-3);
	}
}
