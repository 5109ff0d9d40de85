// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a tick costs; see bench_loop.h. The bench's own scenes have every force there is,
 * guard and limits, over a plane, a sphere, and sheets of 2 mm waves as meshes that are
 * written to memory as files and read as a user's would be:
 *
 *        _       _       _
 *      _/ \_   _/ \_   _/ \_    2 mm high, 8 mm long, along x and along y
 *            \_/     \_/          100 mm × 100 mm
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <incise/loop.h>
#include "bench_loop.h"
#include "cli.h"
#include "json.h"
#include "machine.h"
#include "stopwatch.h"
#include "tick_cost.h"

#define SHEET_MM 100.0
#define WAVE_MM 8.0
#define HEIGHT_MM 2.0

/* Of the stroke's time, which goes by faster; and of the clock's for lateness. */
#define MEASURED_S 60
#define QUICK_MEASURED_S 4
#define AWAKE_S 3
#define QUICK_AWAKE_S 0.5

static const char all_forces[] =
	"arithmetic = \"%s\";\n"
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
#define OWN (sizeof(own) / sizeof(*own))

struct row {
	const char *name;
	size_t memory, triangles;
	double load_s;
	struct tick_cost cost;
};

struct lateness {
	double median, p999, max; /* us */
	uint64_t ticks, skipped;
};

/* A file in memory, gone with the program, that has a path like any other. */
struct file {
	FILE *out;
	char path[32];
};

static struct file file_begin(const char *name)
{
	struct file file;
	int fd = memfd_create(name, MFD_CLOEXEC);

	file.out = fd < 0 ? NULL : fdopen(fd, "w");
	if (!file.out)
		cli_fail("no room for %s in memory: %s", name, strerror(errno));
	snprintf(file.path, sizeof(file.path), "/proc/self/fd/%d", fd);
	return file;
}

static void file_written(const struct file *file)
{
	if (fflush(file->out))
		cli_fail("no room for a file in memory: %s", strerror(errno));
}

static struct file write_sheet(int cells)
{
	struct file file = file_begin("sheet");
	int side = cells + 1;

	for (int k = 0; k < side * side; k++) {
		double x = SHEET_MM * ((double)(k % side) / cells - 0.5);
		double y = SHEET_MM * ((double)(k / side) / cells - 0.5);
		double z = HEIGHT_MM / 4 *
			   (cos(2 * M_PI * x / WAVE_MM) + cos(2 * M_PI * y / WAVE_MM));

		fprintf(file.out, "v %.6f %.6f %.6f\n", x, y, z);
	}
	for (int k = 0; k < cells * cells; k++) {
		int a = k / cells * side + k % cells + 1;

		fprintf(file.out, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a,
			a + side + 1, a + side);
	}
	file_written(&file);
	return file;
}

static void measure(const char *path, bool quick, struct row *row)
{
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan;
	double begin = stopwatch_ns();

	scene = incise_scene_load(path, NULL, &err);
	if (!scene)
		cli_fail_with(&err);
	row->load_s = (stopwatch_ns() - begin) * 1e-9;
	plan = incise_plan_new(scene, NULL, &err);
	if (!plan)
		cli_fail_with(&err);
	row->memory = incise_plan_memory(plan);
	incise_plan_free(plan);
	tick_cost(scene, NULL, quick ? QUICK_MEASURED_S : MEASURED_S, &row->cost);
	if (!row->cost.ticks)
		cli_fail("%s: a stroke over its top met no tissue: nothing to time",
			 path);
	incise_scene_free(scene);
}

static struct file write_scene(size_t i, const char *sheet)
{
	struct file file = file_begin("scene");
	char surface[120];

	snprintf(surface, sizeof(surface), own[i].surface, sheet);
	fprintf(file.out, all_forces, own[i].arithmetic, surface);
	file_written(&file);
	return file;
}

static void measure_own(size_t i, bool quick, struct row *row)
{
	struct file sheet = {0}, scene;

	cli_progress("%s", own[i].name);
	if (own[i].cells)
		sheet = write_sheet(own[i].cells);
	scene = write_scene(i, sheet.path);
	row->name = own[i].name;
	row->triangles = 2 * (size_t)own[i].cells * own[i].cells;
	measure(scene.path, quick, row);
	fclose(scene.out);
	if (sheet.out)
		fclose(sheet.out);
}

/* The loop in real time, on the virtual rig: what the machine and its scheduler do. */
static void measure_lateness(const char *path, bool quick, struct lateness *late)
{
	static struct incise_loop_stats stats;
	struct incise_loop_options options = {.stop = &cli_stop};
	struct incise_error err = {0};
	struct incise_scene *scene = incise_scene_load(path, NULL, &err);
	struct incise_plan *plan;
	struct incise_rig *rig;

	if (!scene)
		cli_fail_with(&err);
	rig = incise_rig_open("sim:", INCISE_RIG_TRACKER, &err);
	if (!rig)
		cli_fail_with(&err);
	plan = incise_plan_new(scene, rig, &err);
	if (!plan)
		cli_fail_with(&err);
	options.rate_hz = incise_scene_rate_hz(scene);
	options.duration_ns = (int64_t)((quick ? QUICK_AWAKE_S : AWAKE_S) * 1e9);
	if (incise_loop_run(plan, incise_rig_clock(rig), &options, &stats, &err))
		cli_fail_with(&err);
	*late = (struct lateness){
		.median = incise_loop_quantile(stats.lateness_us, 0.5),
		.p999 = incise_loop_quantile(stats.lateness_us, 0.999),
		.max = stats.lateness_max_ns * 1e-3,
		.ticks = stats.ticks,
		.skipped = stats.skipped,
	};
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
}

/* ---- report ---- */

static json_t *cost_json(const struct tick_cost *cost)
{
	return json_pack("{sf sf sf}", "median", cost->median, "p99", cost->p99, "p999",
			 cost->p999);
}

static void print_json(const struct row *rows, size_t n, const struct lateness *late)
{
	json_t *list = json_array();
	struct machine machine;

	machine_init(&machine);
	for (size_t i = 0; i < n; i++)
		json_array_append_new(
			list,
			json_pack("{so sI sI sf si so}", "name", json_text(rows[i].name),
				  "triangles", (json_int_t)rows[i].triangles,
				  "memory_bytes", (json_int_t)rows[i].memory, "load_s",
				  rows[i].load_s, "ticks", rows[i].cost.ticks, "tick_ns",
				  cost_json(&rows[i].cost)));
	json_print(json_pack(
		"{so so so s{so so so sI sI} sn}", "machine", machine_json(&machine),
		"tick_ns", cost_json(&rows[0].cost), "rows", list, "lateness_us",
		"median", json_number(late->median), "p999", json_number(late->p999),
		"max", json_number(late->max), "ticks", (json_int_t)late->ticks,
		"skipped", (json_int_t)late->skipped, "cyclictest_us"));
}

static void print_text(const struct row *rows, size_t n, const struct lateness *late)
{
	struct machine machine;

	machine_init(&machine);
	printf("%s, %s\n\n%-12s %9s %9s %9s %9s %10s\n", machine.cpu, machine.kernel,
	       "ns a tick", "median", "99 %", "99.9 %", "load/ms", "memory/KiB");
	for (size_t i = 0; i < n; i++)
		printf("%-12s %9.0f %9.0f %9.0f %9.1f %10.1f\n", rows[i].name,
		       rows[i].cost.median, rows[i].cost.p99, rows[i].cost.p999,
		       rows[i].load_s * 1e3, (double)rows[i].memory / 1024);
	printf("\nwake-up     median < %g us, 99.9 %% < %g us, max %.0f us late; %llu ticks, "
	       "%llu skipped, by the scheduler of this shell\n",
	       late->median, late->p999, late->max, (unsigned long long)late->ticks,
	       (unsigned long long)late->skipped);
}

void bench_loop(const char *scene, bool json, bool quick)
{
	struct row rows[OWN] = {0};
	size_t n = scene ? 1 : OWN;
	struct lateness late;

	if (scene) {
		rows[0].name = scene;
		measure(scene, quick, &rows[0]);
		measure_lateness(scene, quick, &late);
	} else {
		struct file plain;

		for (size_t i = 0; i < OWN; i++)
			measure_own(i, quick, &rows[i]);
		cli_progress("wake-ups");
		plain = write_scene(0, NULL);
		measure_lateness(plain.path, quick, &late);
		fclose(plain.out);
		cli_progress_end();
	}
	if (json)
		print_json(rows, n, &late);
	else
		print_text(rows, n, &late);
}
