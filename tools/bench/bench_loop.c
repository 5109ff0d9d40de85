// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench loop: what a tick of the haptic loop costs, how late the machine wakes it
 * (wakeup.h), and how the error of the force depends on its rate.
 */
#include <stdio.h>
#include <string.h>
#include <incise/backend.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include "bench.h"
#include "../../lib/sim/sim.h"
#include "../cli/file.h"
#include "../cli/json.h"
#include "../cli/stopwatch.h"
#include "../cli/tick_cost.h"
#include "sheet.h"
#include "wakeup.h"

/* --- the cost of a tick: scenes with every force and limits, or the user's --- */

/* Of the stroke's time, which goes by faster. */
#define MEASURED_S 60
#define QUICK_MEASURED_S 4
#define TURN_TICKS 2000
#define TURNS 49
#define QUICK_TURNS 7

static const char all_forces[] =
	"rate_hz = %.1f;\narithmetic = \"%s\";\n"
	"surface = { %s };\n"
	"tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; damping_N_s_mm = 0.0005;\n"
	"  insertion_N_mm = 0.28; spread_N_mm = 0.22; };\n"
	"effects = { average_ticks = 8; };\n";

static const struct own {
	const char *name, *arithmetic, *surface;
	int cells; /* along each side of a sheet; two triangles each */
	int cuts;  /* in the tissue before */
} own[] = {
	{"plane", "double", "kind = \"plane\";", 0, 0},
	{"plane_fixed", "fixed", "kind = \"plane\";", 0, 0},
	{"sphere", "double",
	 "kind = \"sphere\"; centre_mm = [0.0, 0.0, -50.0]; radius_mm = 50.0;", 0, 0},
	{"mesh_20000", "double", "kind = \"mesh\"; file = \"%s\";", 100, 0},
	{"mesh_500000", "double", "kind = \"mesh\"; file = \"%s\";", 500, 0},
	{"mesh_500000_cuts", "double", "kind = \"mesh\"; file = \"%s\";", 500, 32},
};

struct tick_row {
	const char *name, *failed;
	size_t memory, triangles;
	int cuts;
	double load_s;
	struct tick_cost cost;
	struct harness_time time; /* of a tick, in turn with the others */
	/* While they are measured: */
	struct incise_scene *scene;
	struct tick_stroke *timed;
};

static void load_scene(const char *path, struct tick_row *row)
{
	struct incise_error err = {0};
	struct incise_plan *plan;
	double begin = stopwatch_ns();

	row->scene = cli_require(incise_scene_load(path, NULL, &err), &err);
	row->load_s = (stopwatch_ns() - begin) * 1e-9;
	plan = cli_require(incise_plan_new(row->scene, NULL, &err), &err);
	row->memory = incise_plan_memory(plan);
	incise_plan_free(plan);
}

static double turn_ns(void *context)
{
	static double buffer[TURN_TICKS];
	const struct tick_row *row = context;

	/* Caches and branches are those of the variants before. */
	tick_stroke_ns(row->timed, TURN_TICKS / 4, buffer);
	return tick_stroke_ns(row->timed, TURN_TICKS, buffer);
}

/* Quantiles of a long run each, and then medians in turn. */
static void time_ticks(struct tick_row *rows, int n, bool quick)
{
	struct harness_variant variants[N(own)];

	for (int i = 0; i < n; i++) {
		cli_progress("%s", rows[i].name);
		tick_cost(rows[i].scene, NULL, rows[i].cuts,
			  quick ? QUICK_MEASURED_S : MEASURED_S, &rows[i].cost);
		if (!rows[i].cost.ticks)
			cli_fail(
				"%s: a stroke over its top met no tissue: nothing to time",
				rows[i].name);
		rows[i].timed = tick_stroke_new(rows[i].scene, NULL, rows[i].cost.tool,
						rows[i].cuts);
		variants[i] = (struct harness_variant){
			.ns = turn_ns, .context = &rows[i], .time = &rows[i].time};
	}
	harness_times(variants, n, quick ? QUICK_TURNS : TURNS);
	for (int i = 0; i < n; i++) {
		tick_stroke_free(rows[i].timed);
		incise_scene_free(rows[i].scene);
	}
}

static struct memory_file write_scene(const struct own *own, const char *sheet,
				      double rate_hz)
{
	struct memory_file file = memory_file_begin("scene");
	char surface[120];

	snprintf(surface, sizeof(surface), own->surface, sheet);
	fprintf(file.file, all_forces, rate_hz, own->arithmetic, surface);
	memory_file_written(&file);
	return file;
}

static struct memory_file plane(double rate_hz)
{
	return write_scene(&own[0], NULL, rate_hz);
}

static void load_own(const struct own *own, struct tick_row *row)
{
	struct memory_file sheet = {0}, scene;

	cli_progress("%s", own->name);
	if (own->cells)
		sheet = sheet_of_waves(own->cells);
	scene = write_scene(own, sheet.path, 1000);
	row->name = own->name;
	row->triangles = 2 * (size_t)own->cells * own->cells;
	row->cuts = own->cuts;
	load_scene(scene.path, row);
	fclose(scene.file);
	if (sheet.file)
		fclose(sheet.file);
}

static const struct bench_table tick_table = {
	.key = "rows",
	.row_bytes = sizeof(struct tick_row),
	.columns = {COLUMN(tick_row, "name", name, "%-16s", "ns a tick"),
		    COLUMN(tick_row, "triangles", triangles),
		    COLUMN(tick_row, "cuts", cuts), COLUMN(tick_row, "ticks", cost.ticks),
		    COLUMN(tick_row, "tick_ns.median", cost.median, "%9.0f", "median"),
		    COLUMN(tick_row, "tick_ns.p99", cost.p99, "%9.0f", "99 %"),
		    COLUMN(tick_row, "tick_ns.p999", cost.p999, "%9.0f", "99.9 %"),
		    COLUMN(tick_row, "load_s", load_s, "%9.1f", "load/ms",
			   .text_scale = 1e3),
		    COLUMN(tick_row, "memory_bytes", memory, "%10.1f", "memory/KiB",
			   .text_scale = 1.0 / 1024),
		    COLUMN(tick_row, "ns", time.ns.median),
		    COLUMN(tick_row, "ns_p5", time.ns.p5),
		    COLUMN(tick_row, "ns_p95", time.ns.p95),
		    COLUMN(tick_row, "failed", failed)},
	.metrics = {METRIC(TIME, tick_row, time, "ns", "tick {name}")},
};

/* --- error of the force over the loop's rate, on the virtual rig in simulated time ---
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

/* Whole numbers of ns, and multiples of all rates. */
#define POINT_HZ 64000
#define QUICK_POINT_HZ 16000

/* Of the stroke's time that the cost of a tick is taken of. */
#define COST_S 20
#define QUICK_COST_S 2

static const int rates_hz[] = {250, 500, 1000, 2000, 4000, 8000};

static const struct cut_series {
	const char *wall, *poses;
	double stiffness_N_mm, depth_mm; /* some 3 N */
	bool exact;			 /* a pose at each tick, without noise, at once */
} cut_series[] = {
	{"wall", "tracker", 0.33, 10, false},
	{"wall", "exact", 0.33, 10, true},
	{"stiff", "exact", 1.5, 2, true},
};

/* Of a force against the exact one, over a cut. */
struct rate_error {
	double rms_N, max_N;
	double relative; /* rms as part of the exact force's rms */
};

struct rate_row {
	const char *wall, *poses;
	double rate_hz;
	double stiffness_N_mm, limit_N_mm; /* limit: NaN where it is not known */
	struct rate_error command, rendered;
	double hold_N;	  /* rms of an ideal sample and hold */
	double tick_ns;	  /* median */
	double ns_per_s;  /* of haptics */
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
	row->limit_N_mm = stability.limit_N_mm;
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
	struct incise_tracker_info info;
	struct incise_scene *scene = plain_wall(row);
	struct incise_rig *rig;
	struct tick_cost cost;
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
	incise_tracker_info(incise_rig_tracker(rig), &info);
	run_plan(scene, rig, quick ? QUICK_POINT_HZ : POINT_HZ, row);
	if (*row->failed) {
		row->command = row->rendered = (struct rate_error){NAN, NAN, NAN};
	} else {
		tick_cost(scene, &info, 0, quick ? QUICK_COST_S : COST_S, &cost);
		row->tick_ns = cost.median;
		row->ns_per_s = cost.median * row->rate_hz;
	}
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
					     .limit_N_mm = NAN,
					     .hold_N = NAN,
					     .tick_ns = NAN,
					     .ns_per_s = NAN};
		cli_progress("%s, %s poses, %g Hz", s->wall, s->poses, rates[i].rate_hz);
		measure_rate(s, quick, &rates[i]);
	}
	cli_progress_end();
}

static const struct bench_table rates_table = {
	.key = "rates",
	.row_bytes = sizeof(struct rate_row),
	.failed_after = 3,
	.columns = {COLUMN(rate_row, "wall", wall, "%-6s", "wall"),
		    COLUMN(rate_row, "poses", poses, "%-8s", "poses"),
		    COLUMN(rate_row, "rate_hz", rate_hz, "%6g", "Hz"),
		    COLUMN(rate_row, "stiffness_N_mm", stiffness_N_mm),
		    COLUMN(rate_row, "limit_N_mm", limit_N_mm),
		    COLUMN(rate_row, "command.rms_error_N", command.rms_N, "%8.3f", "rms",
			   .text_scale = 1e3),
		    COLUMN(rate_row, "command.max_error_N", command.max_N, "%8.2f", "max",
			   .text_scale = 1e3),
		    COLUMN(rate_row, "command.relative", command.relative, "%6.3f", "%",
			   .text_scale = 100),
		    COLUMN(rate_row, "rendered.rms_error_N", rendered.rms_N, "%8.2f",
			   "rms", .text_scale = 1e3),
		    COLUMN(rate_row, "rendered.max_error_N", rendered.max_N, "%8.2f",
			   "max", .text_scale = 1e3),
		    COLUMN(rate_row, "rendered.relative", rendered.relative, "%6.3f", "%",
			   .text_scale = 100),
		    COLUMN(rate_row, "hold_N", hold_N, "%8.3f", "hold",
			   .text_scale = 1e3),
		    COLUMN(rate_row, "tick_ns", tick_ns, "%8.0f", "ns/tick"),
		    COLUMN(rate_row, "ns_per_s", ns_per_s, "%9.1f", "us/s",
			   .text_scale = 1e-3),
		    COLUMN(rate_row, "rms_N", command.rms_N, .data = true),
		    COLUMN(rate_row, "rendered_rms_N", rendered.rms_N, .data = true),
		    COLUMN(rate_row, "failed", failed)},
	.metrics = {METRIC(EXACT, rate_row, command.rms_N, "N",
			   "{wall} {poses} command rms at 1 kHz", "rate_hz=1000"),
		    METRIC(EXACT, rate_row, rendered.rms_N, "N",
			   "{wall} {poses} rendered rms at 1 kHz", "rate_hz=1000"),
		    METRIC(EXACT, rate_row, rendered.max_N, "N",
			   "{wall} {poses} rendered largest at 1 kHz", "rate_hz=1000")},
};

/* --- wake-ups --- */

#define AWAKE_S 5
#define QUICK_AWAKE_S 0.5

static const struct bench_table wakeup_table = {
	.key = "wakeups.rows",
	.row_bytes = sizeof(struct wakeup),
	.columns = {COLUMN(wakeup, "load", load), COLUMN(wakeup, "rate_hz", rate_hz),
		    COLUMN(wakeup, "no_load", no_load),
		    COLUMN(wakeup, "no_cyclictest", no_cyclictest),
		    COLUMN(wakeup, "lateness_us", loop.json),
		    COLUMN(wakeup, "cyclictest_us", cyclictest.json),
		    COLUMN(wakeup, "skipped", skipped),
		    COLUMN(wakeup, "skipped_by_machine", machine, .whole = true),
		    COLUMN(wakeup, "ratio_p999", ratio),
		    COLUMN(wakeup, "tick_max_us", tick_max_us),
		    COLUMN(wakeup, "frames_hz", frames_hz),
		    COLUMN(wakeup, "late_median_us", loop.median),
		    COLUMN(wakeup, "late_p99_us", loop.p99),
		    COLUMN(wakeup, "late_p999_us", loop.p999),
		    COLUMN(wakeup, "late_max_us", loop.max),
		    COLUMN(wakeup, "cyclictest_p999_us", cyclictest.p999),
		    COLUMN(wakeup, "failed", no_load),
		    COLUMN(wakeup, "title", title, .data = true)},
	.metrics = {METRIC(MEASURED, wakeup, median, "us",
			   "late at {rate_hz} Hz, {load}, median"),
		    METRIC(MEASURED, wakeup, p999, "us",
			   "late at {rate_hz} Hz, {load}, 99.9 %")},
};

/* A line of text: of the loop, or of cyclictest below it. */
struct line {
	const char *rate, *load, *program, *failed;
	struct lateness late;
	double skipped, machine, ratio;
};

static const struct bench_table line_table = {
	.row_bytes = sizeof(struct line),
	.failed_after = 2,
	.columns = {COLUMN(line, NULL, rate, "%6s", "Hz"),
		    COLUMN(line, NULL, load, "%-6s", "load"),
		    COLUMN(line, NULL, program, "%-10s", "program"),
		    COLUMN(line, NULL, late.min, "%7.0f", "min"),
		    COLUMN(line, NULL, late.median, "%7.0f", "median"),
		    COLUMN(line, NULL, late.p99, "%7.0f", "99 %"),
		    COLUMN(line, NULL, late.p999, "%7.0f", "99.9 %"),
		    COLUMN(line, NULL, late.p9999, "%7.0f", "99.99 %"),
		    COLUMN(line, NULL, late.max, "%8.0f", "max"),
		    COLUMN(line, NULL, skipped, "%8.0f", "skipped"),
		    COLUMN(line, NULL, machine, "%8.0f", "machine"),
		    COLUMN(line, NULL, ratio, "%6.2f", "ratio"),
		    COLUMN(line, "failed", failed)},
};

static void print_wakeups(struct bench_run *run, const struct wakeups *wakeups)
{
	struct line lines[2 * WAKEUPS_MAX];
	const char *no_cyclictest = NULL;
	double frames_hz = NAN;
	int n = 0;

	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup *row = &wakeups->row[i];

		lines[n++] = (struct line){cli_text("%g", row->rate_hz),
					   row->load,
					   "loop",
					   row->no_load,
					   row->loop,
					   (double)row->skipped,
					   row->machine,
					   row->ratio};
		if (row->cyclictest.bins)
			lines[n++] = (struct line){
				" ", " ", "cyclictest", NULL, row->cyclictest,
				NAN, NAN, NAN};
		frames_hz = fmax(frames_hz, row->frames_hz);
		if (!row->no_load && row->no_cyclictest)
			no_cyclictest = row->no_cyclictest;
	}
	bench_text(run, "\nwake-up latency, us; %.3g s each; %s, CPU %d\n",
		   wakeups->seconds,
		   wakeups->realtime ? cli_text("SCHED_FIFO %d", INCISE_REALTIME_PRIORITY)
				     : "SCHED_OTHER, without real-time permission",
		   wakeups->cpu);
	bench_lines(run, &line_table, lines, n);
	if (frames_hz > 0)
		bench_text(run, "view: %.1f frames per second\n", frames_hz);
	if (no_cyclictest)
		bench_text(run, "%s\n", no_cyclictest);
}

/* Histograms for the plot: lower edge, share of all wake-ups. Bins are a tenth wider than the
 * ones before, whole µs at least; both ends are drawn down to the axis. */
static int add_histogram(struct bench_point *points, const struct wakeup *row,
			 const char *program, const struct lateness *l)
{
	int n = 0, from = 0;

	snprintf(points->block, sizeof(points->block), "%g %s %s", row->rate_hz,
		 row->load, program);
	points[n] = points[0];
	points[n++].x = 1;
	while (from < INCISE_LOOP_BINS) {
		int to = from + (from < 10 ? 1 : from / 10);
		uint64_t sum = 0;

		for (int i = from; i < to && i < INCISE_LOOP_BINS; i++)
			sum += l->bins[i];
		/* Lateness within the first µs begins where the axis does. */
		points[n] = points[0];
		points[n].x = fmax(from, 0.9);
		points[n++].y = (double)sum / (double)l->ticks;
		from = to;
	}
	return n;
}

static void report_wakeups(struct bench_run *run, const struct wakeups *wakeups)
{
	static struct bench_point points[2 * WAKEUPS_MAX * 200];
	double most = 1;
	int n = 0;

	bench_values(run, "{s{sf ss so si}}", "wakeups", "seconds", wakeups->seconds,
		     "policy", wakeups_policy(wakeups->realtime), "priority",
		     wakeups->realtime ? json_integer(INCISE_REALTIME_PRIORITY)
				       : json_null(),
		     "cpu", wakeups->cpu);
	print_wakeups(run, wakeups);
	bench_rows(run, &wakeup_table, wakeups->row, wakeups->n);
	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup *row = &wakeups->row[i];

		if (!row->loop.bins)
			continue;
		most = fmax(most, (double)row->loop.ticks);
		n += add_histogram(&points[n], row, "loop", &row->loop);
		if (row->cyclictest.bins)
			n += add_histogram(&points[n], row, "cyclictest",
					   &row->cyclictest);
	}
	bench_rows(run, &bench_points, points, n);
	bench_scalars(run, "{sf sf ss}", "least", 0.5 / most, "seconds", wakeups->seconds,
		      "policy", wakeups->realtime ? "SCHED_FIFO" : "SCHED_OTHER");
}

/* --- the bench --- */

/* Members of the first rows, where scripts look for them. */
static void report_first(struct bench_run *run, const struct tick_row *tick,
			 const struct wakeup *row)
{
	json_t *late = row->loop.json ? json_copy(row->loop.json) : json_null();

	if (row->loop.json)
		json_object_set_new(late, "skipped",
				    json_integer((json_int_t)row->skipped));
	bench_values(run, "{s{sf so so} so sO?}", "tick_ns", "median", tick->cost.median,
		     "p99", json_number(tick->cost.p99), "p999",
		     json_number(tick->cost.p999), "lateness_us", late, "cyclictest_us",
		     row->cyclictest.json);
}

static void run(struct bench_run *run)
{
	static struct tick_row ticks[N(own)];
	static struct wakeups wakeups;
	enum load_kind only =
		run->load ? (enum load_kind)cli_choice("load", run->load, load_names)
			  : LOADS;
	const char *scene = run->n_operands ? run->operands[0] : NULL;
	int n = scene ? 1 : N(own);

	if (scene) {
		ticks[0].name = scene;
		load_scene(scene, &ticks[0]);
	}
	for (int i = 0; i < n && !scene; i++)
		load_own(&own[i], &ticks[i]);
	time_ticks(ticks, n, run->quick);
	measure_rates(run->quick);
	wakeups_measure(scene, plane, only, run->quick,
			run->seconds > 0 ? run->seconds
			: run->quick	 ? QUICK_AWAKE_S
					 : AWAKE_S,
			&wakeups);
	bench_text(run, "%s, %s\n\n", bench_machine(run, "cpu"),
		   bench_machine(run, "kernel"));
	report_first(run, ticks, wakeups.row);
	bench_table(run, &tick_table, ticks, n);
	report_wakeups(run, &wakeups);
	bench_text(run, "\nforce error over a cut, mN           commanded              "
			"rendered        ideal\n");
	bench_table(run, &rates_table, rates, N(rates));
}

const struct bench bench_loop = {
	.name = "loop",
	.operands = "[SCENE]",
	.summary = "run time of a tick; wake-up latency, idle and under\n"
		   "load, compared with cyclictest; error over the rate",
	.n_operands = 1,
	.takes_duration = true,
	.takes_load = true,
	.run = run,
	.plots = {{.suffix = "wakeups",
		   .script = text_loop_wakeups_gp,
		   .width = 480,
		   .height = 240,
		   .across = "rate_hz",
		   .down = "load",
		   .margin = 170,
		   .data = {&wakeup_table, "rate_hz,load,title", "failed="},
		   .more = {&bench_points, "block"}},
		  {.suffix = "rates",
		   .script = text_loop_rates_gp,
		   .width = 1000,
		   .height = 600,
		   .data = {&rates_table, "stiffness_N_mm,poses", "failed="}}},
};
