// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a tick costs; see bench_tick.h. The bench's own scenes have every force there is,
 * guard and limits, over a plane, a sphere, and sheets of 2 mm waves as meshes that are
 * written to memory as files and read as a user's would be:
 *
 *        _       _       _
 *      _/ \_   _/ \_   _/ \_    2 mm high, 8 mm long, along x and along y
 *            \_/     \_/          100 mm × 100 mm
 */
#include <math.h>
#include <stdio.h>
#include "bench_tick.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/stopwatch.h"

#define SHEET_MM 100.0
#define WAVE_MM 8.0
#define HEIGHT_MM 2.0

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
	"effects = { average_ticks = 8; guard = true; };\n";

static const struct {
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
#define OWN (int)(sizeof(own) / sizeof(*own))

_Static_assert(OWN == BENCH_TICK_ROWS, "room for each");

struct memory_file bench_tick_sheet(int cells)
{
	struct memory_file file = memory_file_begin("sheet");
	int side = cells + 1;

	for (int k = 0; k < side * side; k++) {
		double x = SHEET_MM * ((double)(k % side) / cells - 0.5);
		double y = SHEET_MM * ((double)(k / side) / cells - 0.5);
		double z = HEIGHT_MM / 4 *
			   (cos(2 * M_PI * x / WAVE_MM) + cos(2 * M_PI * y / WAVE_MM));

		fprintf(file.file, "v %.6f %.6f %.6f\n", x, y, z);
	}
	for (int k = 0; k < cells * cells; k++) {
		int a = k / cells * side + k % cells + 1;

		fprintf(file.file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a,
			a + side + 1, a + side);
	}
	memory_file_written(&file);
	return file;
}

static void load(const char *path, struct tick_row *row)
{
	struct incise_error err = {0};
	struct incise_plan *plan;
	double begin = stopwatch_ns();

	row->scene = incise_scene_load(path, NULL, &err);
	if (!row->scene)
		cli_fail_with(&err);
	row->load_s = (stopwatch_ns() - begin) * 1e-9;
	plan = incise_plan_new(row->scene, NULL, &err);
	if (!plan)
		cli_fail_with(&err);
	row->memory = incise_plan_memory(plan);
	incise_plan_free(plan);
}

static double turn_ns(void *context)
{
	static double room[TURN_TICKS];
	const struct tick_row *row = context;

	/* Caches and branches are those of the ways before. */
	tick_stroke_ns(row->timed, TURN_TICKS / 4, room);
	return tick_stroke_ns(row->timed, TURN_TICKS, room);
}

/* Quantiles of a long run each, and then medians in turn. */
static void measure(struct tick_row *rows, int n, bool quick)
{
	struct harness_variant timers[BENCH_TICK_ROWS];
	struct harness_time times[BENCH_TICK_ROWS];

	for (int i = 0; i < n; i++) {
		cli_progress("%s", rows[i].name);
		tick_cost(rows[i].scene, NULL, quick ? QUICK_MEASURED_S : MEASURED_S,
			  &rows[i].cost);
		if (!rows[i].cost.ticks)
			cli_fail(
				"%s: a stroke over its top met no tissue: nothing to time",
				rows[i].name);
		rows[i].timed = tick_stroke_new(rows[i].scene, NULL, rows[i].cost.tool);
		timers[i] = (struct harness_variant){.ns = turn_ns, .context = &rows[i]};
	}
	harness_times(timers, n, quick ? QUICK_TURNS : TURNS, times);
	for (int i = 0; i < n; i++) {
		rows[i].time = times[i];
		tick_stroke_free(rows[i].timed);
		incise_scene_free(rows[i].scene);
	}
}

static struct memory_file write_scene(int i, const char *sheet, double rate_hz)
{
	struct memory_file file = memory_file_begin("scene");
	char surface[120];

	snprintf(surface, sizeof(surface), own[i].surface, sheet);
	fprintf(file.file, all_forces, rate_hz, own[i].arithmetic, surface);
	memory_file_written(&file);
	return file;
}

static void load_own(int i, struct tick_row *row)
{
	struct memory_file sheet = {0}, scene;

	cli_progress("%s", own[i].name);
	if (own[i].cells)
		sheet = bench_tick_sheet(own[i].cells);
	scene = write_scene(i, sheet.path, 1000);
	row->name = own[i].name;
	row->triangles = 2 * (size_t)own[i].cells * own[i].cells;
	load(scene.path, row);
	fclose(scene.file);
	if (sheet.file)
		fclose(sheet.file);
}

struct memory_file bench_tick_plane(double rate_hz)
{
	return write_scene(0, NULL, rate_hz);
}

int bench_tick(const char *scene, bool quick, struct tick_row rows[BENCH_TICK_ROWS])
{
	if (scene) {
		rows[0].name = scene;
		load(scene, &rows[0]);
	}
	for (int i = 0; i < OWN && !scene; i++)
		load_own(i, &rows[i]);
	measure(rows, scene ? 1 : OWN, quick);
	return scene ? 1 : OWN;
}

/* ---- report ---- */

json_t *tick_cost_json(const struct tick_cost *cost)
{
	return json_pack("{so so so}", "median", json_number(cost->median), "p99",
			 json_number(cost->p99), "p999", json_number(cost->p999));
}

json_t *tick_row_json(const struct tick_row *row)
{
	return json_pack("{so sI sI so si so so so so sn}", "name", json_text(row->name),
			 "triangles", (json_int_t)row->triangles, "memory_bytes",
			 (json_int_t)row->memory, "load_s", json_number(row->load_s),
			 "ticks", row->cost.ticks, "tick_ns", tick_cost_json(&row->cost),
			 "ns", json_number(row->time.ns.median), "ns_p5",
			 json_number(row->time.ns.p5), "ns_p95",
			 json_number(row->time.ns.p95), "failed");
}

void tick_rows_print(const struct tick_row *rows, int n)
{
	printf("%-12s %9s %9s %9s %9s %10s\n", "ns a tick", "median", "99 %", "99.9 %",
	       "load/ms", "memory/KiB");
	for (int i = 0; i < n; i++)
		printf("%-12s %9.0f %9.0f %9.0f %9.1f %10.1f\n", rows[i].name,
		       rows[i].cost.median, rows[i].cost.p99, rows[i].cost.p999,
		       rows[i].load_s * 1e3, (double)rows[i].memory / 1024);
}

void tick_rows_figures(const struct tick_row *rows, int n, json_t *figures)
{
	for (int i = 0; i < n; i++)
		metrics_time(figures, &rows[i].time, "ns", "tick %s", rows[i].name);
}
