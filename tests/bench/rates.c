// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * rates: error of the force over the rate of the loop, on the virtual rig in simulated time.
 *
 * A cut of the virtual surgeon into a plain wall, whose force is known at any time: K times
 * the depth of the blade, which the virtual rig has. All forces are compared at 64 kHz:
 *
 *   exact       ___...---''''
 *   asked for   ____|''''|''''    held between ticks, from poses that are late and noisy
 *   rendered    ______.-'''.-'    the actuator's spring in between
 *               |    |    |       ticks; between them 8 … 256 points
 *
 * An ideal sample and hold is off by F' times the age of the sample, 0 … T, which is
 * rms F' · T/√3: no loop that does not predict is better.
 */
#include <stdio.h>
#include <string.h>
#include <incise/backend.h>
#include <incise/plan.h>
#include "../../lib/sim/sim.h"
#include "../../tools/cli/file.h"
#include "program.h"

/* Whole numbers of ns, and multiples of all rates. */
#define POINT_HZ 64000
#define QUICK_POINT_HZ 16000

static const int rates_hz[] = {250, 500, 1000, 2000, 4000, 8000};

static const struct cut_series {
	const char *wall, *poses;
	double stiffness_N_mm, depth_mm; /* some 3 N */
	bool exact;			 /* a pose at each tick, without noise, at once */
} cut_series[] = {
	{"wall", "tracker", 0.33, 10, false},
	{"wall", "exact", 0.33, 10, true},
	{"stiff", "exact", 1.3, 2, true},
};

/* Of a force against the exact one, over a cut. */
struct rate_error {
	double rms_N, max_N;
	double relative; /* rms as part of the exact force's rms */
};

struct rate_row {
	const char *wall, *poses;
	double rate_hz;
	double stiffness_N_mm, margin; /* margin: NaN where it is not known */
	struct rate_error command, rendered;
	double hold_N;	  /* rms of an ideal sample and hold */
	char failed[512]; /* why it was not measured; else empty */
};

/* A tracker with the place of the tip now, once a tick: as an encoder would. */
static struct exact_tracker {
	struct incise_tracker_ops ops;
	const struct incise_tracker_ops *before;
	struct incise_sim *sim;
	double rate_hz;
	uint64_t seq;
} * exact; /* of the run under way: ops have no context */

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
	double command2, rendered2, exact2, slope2, before;
	int point_hz;
	uint64_t n;
};

static void add_point(struct sums *sums, struct rate_row *row, double exact_N,
		      double command_N, double rendered_N)
{
	double command = command_N - exact_N, rendered = rendered_N - exact_N;
	double slope = (exact_N - sums->before) * sums->point_hz;

	if (sums->n++)
		sums->slope2 += slope * slope;
	sums->before = exact_N;
	sums->exact2 += exact_N * exact_N;
	sums->command2 += command * command;
	sums->rendered2 += rendered * rendered;
	row->command.max_N = fmax(row->command.max_N, fabs(command));
	row->rendered.max_N = fmax(row->rendered.max_N, fabs(rendered));
}

static void finish(const struct sums *sums, struct rate_row *row)
{
	double n = (double)sums->n, all = sqrt(sums->exact2 / n);

	row->command.rms_N = sqrt(sums->command2 / n);
	row->command.relative = row->command.rms_N / all;
	row->rendered.rms_N = sqrt(sums->rendered2 / n);
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
			add_point(&sums, row, row->stiffness_N_mm * truth.depth_mm,
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
		/* The file's name means nothing here, nor how to mend it. */
		text = strchr(err.text, ' ');
		text = text ? text + 1 : err.text;
		snprintf(row->failed, sizeof(row->failed), "%.*s",
			 (int)strcspn(text, ";"), text);
		return;
	}
	incise_plan_stability(plan, &stability);
	row->margin = stability.weakest.margin;
	rc = cut(plan, rig, point_hz, row);
	if (rc)
		snprintf(row->failed, sizeof(row->failed), "a tick failed: %s",
			 strerror(-rc));
	incise_plan_free(plan);
}

static struct incise_scene *plain_wall(const struct rate_row *row)
{
	struct memory_file file = memory_file_begin("scene");
	struct incise_error err = {0};
	struct incise_scene *scene;

	/* In double: the error of the loop is looked for, not that of the digits. */
	fprintf(file.file,
		"rate_hz = %.1f;\narithmetic = \"double\";\ntissue = { reaction_N_mm = %g; };\n",
		row->rate_hz, row->stiffness_N_mm);
	memory_file_written(&file);
	scene = cli_require(incise_scene_load(file.path, NULL, &err), &err);
	fclose(file.file);
	return scene;
}

static void measure_rate(const struct cut_series *s, bool quick, struct rate_row *row)
{
	struct exact_tracker tracker = {.rate_hz = row->rate_hz};
	struct incise_error err = {0};
	struct incise_scene *scene = plain_wall(row);
	struct incise_rig *rig;
	char spec[80];

	snprintf(spec, sizeof(spec), "sim:clock=simulated,depth_mm=%g,times=1",
		 s->depth_mm);
	rig = cli_require(incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER,
					  &err),
			  &err);
	if (s->exact) {
		tracker.before = incise_rig_tracker(rig)->ops;
		tracker.ops = *tracker.before;
		tracker.ops.read = exact_read;
		tracker.ops.info = exact_info;
		tracker.sim = incise_rig_sim(rig);
		exact = &tracker;
		incise_rig_tracker(rig)->ops = &tracker.ops;
	}
	run_plan(scene, rig, quick ? QUICK_POINT_HZ : POINT_HZ, row);
	if (*row->failed)
		row->command = row->rendered = (struct rate_error){NAN, NAN, NAN};
	if (s->exact)
		incise_rig_tracker(rig)->ops = tracker.before;
	incise_rig_close(rig);
	incise_scene_free(scene);
}

static struct rate_row rates[N(cut_series) * N(rates_hz)];

static void measure_rates(bool quick)
{
	for (int i = 0; i < N(rates); i++) {
		const struct cut_series *s = &cut_series[i / N(rates_hz)];

		rates[i] = (struct rate_row){.wall = s->wall,
					     .poses = s->poses,
					     .rate_hz = rates_hz[i % N(rates_hz)],
					     .stiffness_N_mm = s->stiffness_N_mm,
					     .margin = NAN,
					     .hold_N = NAN};
		cli_progress("%s, %s poses, %g Hz", s->wall, s->poses, rates[i].rate_hz);
		measure_rate(s, quick, &rates[i]);
	}
	cli_progress_end();
}

static const struct bench_table rates_table = {
	.key = "rates",
	.row_bytes = sizeof(struct rate_row),
	.columns = {COLUMN(rate_row, "wall", wall), COLUMN(rate_row, "poses", poses),
		    COLUMN(rate_row, "rate_hz", rate_hz),
		    COLUMN(rate_row, "stiffness_N_mm", stiffness_N_mm),
		    COLUMN(rate_row, "margin", margin),
		    COLUMN(rate_row, "command.rms_error_N", command.rms_N),
		    COLUMN(rate_row, "command.max_error_N", command.max_N),
		    COLUMN(rate_row, "command.relative", command.relative),
		    COLUMN(rate_row, "rendered.rms_error_N", rendered.rms_N),
		    COLUMN(rate_row, "rendered.max_error_N", rendered.max_N),
		    COLUMN(rate_row, "rendered.relative", rendered.relative),
		    COLUMN(rate_row, "hold_N", hold_N),
		    COLUMN(rate_row, "failed", failed)},
	.metrics = {METRIC(EXACT, rate_row, command.rms_N, "N",
			   "{wall} {poses} command rms at 1 kHz", "rate_hz=1000"),
		    METRIC(EXACT, rate_row, rendered.rms_N, "N",
			   "{wall} {poses} rendered rms at 1 kHz", "rate_hz=1000"),
		    METRIC(EXACT, rate_row, rendered.max_N, "N",
			   "{wall} {poses} rendered largest at 1 kHz", "rate_hz=1000")},
};

static void run_rates(struct bench_run *run)
{
	measure_rates(run->quick);
	bench_rows(run, &rates_table, rates, N(rates));
}

const struct bench bench_program = {
	.name = "rates",
	.summary = "error of the force over the rate of the loop",
	.run = run_rates,
};
