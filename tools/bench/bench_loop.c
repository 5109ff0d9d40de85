// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench loop: the cost of a tick of the haptic loop, and how late the machine wakes
 * it (wakeup.h).
 */
#include <stdio.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include "bench.h"
#include "../cli/file.h"
#include "../cli/json.h"
#include "../cli/stopwatch.h"
#include "sheet.h"
#include "tick_cost.h"
#include "wakeup.h"

/* --- the cost of a tick: scenes with every force and limits, or the user's --- */

/* Pace of the stroke's time, which goes by faster. */
#define MEASURED_S 60
#define QUICK_MEASURED_S 4
#define TURN_TICKS 2000
#define TURNS 49
#define QUICK_TURNS 7

static const char all_forces[] =
	"rate_hz = %.1f;\narithmetic = \"%s\";\n"
	"surface = { %s };\n"
	"tissue = { gain = 0.5; reaction_N_mm = 0.14; plane_N_mm = 0.17;\n"
	"  damping_N_s_mm = 0.0005; insertion_N_mm = 0.28; spread_N_mm = 0.22; };\n"
	"effects = { average_ticks = 8; };\n";

static const struct own {
	const char *name, *arithmetic, *surface;
	int cells; /* along each side of a sheet; two triangles each */
} own[] = {
	{"plane", "double", "kind = \"plane\";", 0},
	{"plane_fixed", "fixed", "kind = \"plane\";", 0},
	{"sphere", "double",
	 "kind = \"sphere\"; centre_mm = [0.0, 0.0, -50.0]; radius_mm = 50.0;", 0},
	{"mesh_20000", "double", "kind = \"mesh\"; file = \"%s\";", 100},
	{"mesh_500000", "double", "kind = \"mesh\"; file = \"%s\";", 500},
};

struct tick_row {
	const char *name, *failed;
	size_t memory, triangles;
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

	/* Caches and branches are as the variants before left them. */
	tick_stroke_ns(row->timed, TURN_TICKS / 4, buffer);
	return tick_stroke_ns(row->timed, TURN_TICKS, buffer);
}

/* Quantiles of a long run each, and then medians in turn. */
static void time_ticks(struct tick_row *rows, int n, bool quick)
{
	struct harness_variant variants[N(own)];

	for (int i = 0; i < n; i++) {
		cli_progress("%s", rows[i].name);
		tick_cost(rows[i].scene, NULL, NULL,
			  quick ? QUICK_MEASURED_S : MEASURED_S, &rows[i].cost);
		if (!rows[i].cost.ticks)
			cli_fail(
				"%s: a stroke over its top met no tissue: nothing to time",
				rows[i].name);
		rows[i].timed =
			tick_stroke_new(rows[i].scene, NULL, NULL, rows[i].cost.tool);
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
		sheet = sheet_of_waves(own->cells, false);
	scene = write_scene(own, sheet.path, 1000);
	row->name = own->name;
	row->triangles = 2 * (size_t)own->cells * own->cells;
	load_scene(scene.path, row);
	fclose(scene.file);
	if (sheet.file)
		fclose(sheet.file);
}

static const struct bench_table tick_table = {
	.key = "rows",
	.row_bytes = sizeof(struct tick_row),
	.columns = {COLUMN(tick_row, "name", name, "%-16s", "ns a tick, hot"),
		    COLUMN(tick_row, "triangles", triangles),
		    COLUMN(tick_row, "ticks", cost.ticks),
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

/* --- wake-ups --- */

#define AWAKE_S 5
#define QUICK_AWAKE_S 0.5

static const struct bench_table wakeup_table = {
	.key = "wakeups.rows",
	.row_bytes = sizeof(struct wakeup),
	.failed_after = 2,
	.columns = {COLUMN(wakeup, "rate_hz", rate_hz, "%6g", "Hz"),
		    COLUMN(wakeup, "load", load, "%-6s", "load"),
		    COLUMN(wakeup, "no_load", no_load),
		    COLUMN(wakeup, "no_cyclictest", no_cyclictest),
		    COLUMN(wakeup, "lateness_us", loop.json),
		    COLUMN(wakeup, "cyclictest_us", cyclictest.json),
		    COLUMN(wakeup, NULL, loop.median, "%7.0f", "median"),
		    COLUMN(wakeup, NULL, loop.p99, "%7.0f", "99 %"),
		    COLUMN(wakeup, NULL, loop.p999, "%7.0f", "99.9 %"),
		    COLUMN(wakeup, NULL, loop.max, "%8.0f", "max"),
		    COLUMN(wakeup, NULL, cyclictest.p999, "%18.0f", "cyclictest: 99.9 %"),
		    COLUMN(wakeup, NULL, cyclictest.max, "%8.0f", "max"),
		    COLUMN(wakeup, "skipped", skipped, "%8.0f", "skipped"),
		    COLUMN(wakeup, "skipped_by_machine", machine, "%8.0f", "machine",
			   .whole = true),
		    COLUMN(wakeup, "ratio_p999", ratio, "%6.2f", "ratio"),
		    COLUMN(wakeup, "tick_cold_us", tick_us, "%6.1f", "tick"),
		    COLUMN(wakeup, "tick_max_us", tick_max_us),
		    COLUMN(wakeup, "frames_hz", frames_hz),
		    COLUMN(wakeup, "failed", no_load)},
	.metrics = {METRIC(MEASURED, wakeup, median, "us",
			   "late at {rate_hz} Hz, {load}, median"),
		    METRIC(MEASURED, wakeup, p999, "us",
			   "late at {rate_hz} Hz, {load}, 99.9 %")},
};

static void report_wakeups(struct bench_run *run, const struct wakeups *wakeups)
{
	const char *no_cyclictest = NULL;
	double frames_hz = NAN;

	bench_values(run, "{s{sf ss so si}}", "wakeups", "seconds", wakeups->seconds,
		     "policy", wakeups->realtime ? "fifo" : "other", "priority",
		     wakeups->realtime ? json_integer(INCISE_REALTIME_PRIORITY)
				       : json_null(),
		     "cpu", wakeups->cpu);
	for (const struct wakeup *row = wakeups->row; row < wakeups->row + wakeups->n;
	     row++) {
		frames_hz = fmax(frames_hz, row->frames_hz);
		if (!row->no_load && row->no_cyclictest)
			no_cyclictest = row->no_cyclictest;
	}
	bench_text(run, "\nwake-up latency, us; %.3g s each; %s, CPU %d\n",
		   wakeups->seconds,
		   wakeups->realtime ? cli_text("SCHED_FIFO %d", INCISE_REALTIME_PRIORITY)
				     : "SCHED_OTHER, without real-time permission",
		   wakeups->cpu);
	bench_table(run, &wakeup_table, wakeups->row, wakeups->n);
	bench_text(run,
		   "tick: median after each sleep, with cold caches and the rig; the "
		   "first table is of ticks in a row, with hot caches\n");
	if (frames_hz > 0)
		bench_text(run, "view: %.1f frames per second\n", frames_hz);
	if (no_cyclictest)
		bench_text(run, "%s\n", no_cyclictest);
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
}

const struct bench bench_loop = {
	.name = "loop",
	.operands = "[SCENE]",
	.summary = "run time of a tick; wake-up latency, idle and under "
		   "load, compared with cyclictest",
	.n_operands = 1,
	.takes_duration = true,
	.takes_load = true,
	.run = run,
};
