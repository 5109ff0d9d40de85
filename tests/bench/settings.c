// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error against run time of what has a setting.
 *
 *   heights    a mesh, and grids of its heights by the size of a cell, compared with the sphere that both
 *              stand for
 *   trackers   the predictor's error, by rate and latency
 */
#include <stdio.h>
#include <incise/plan.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "../../lib/control/predict.h"
#include "../../lib/scene/heights.h"
#include "../../lib/surface/surface.h"
#include "../../tools/cli/file.h"
#include "../../tools/cli/stopwatch.h"
#include "program.h"

#define PERIOD_S 1e-3
#define REPEATS(run) ((run)->quick ? 5 : 31)

/* --- heights of a mesh ---------------------------------------------------------------------- */

#define RADIUS_MM 55.0
#define HALF_MM 30.0
#define CELLS 33 /* of the mesh, along each side */
#define PLACES 4000
#define K_N_mm 0.14
#define LEAVE_MM 0.2
#define REACH_MM 4
#define DEEP_MM 0.5

static struct grid_row {
	const char *name;
	double wanted_mm; /* bound of the depth; 0: the mesh itself */

	double cell_mm, bound_mm, reach_mm, depth_mm, normal_rad, force_N, kB;
	struct harness_time time; /* of a place */
	char failed[200];
	const struct incise_surface *mesh;
	struct incise_heights heights;
	struct incise_fixed_grid grid;
} grids[] = {{"mesh", 0},    {"grid", 0.3},  {"grid", 0.1},  {"grid", 0.05},
	     {"grid", 0.03}, {"grid", 0.01}, {"grid", 0.007}};

static const struct bench_table grid_table = {
	.key = "heights",
	.row_bytes = sizeof(struct grid_row),
	.columns = {COLUMN(grid_row, "name", name),
		    COLUMN(grid_row, "wanted_mm", wanted_mm, .optional = true),
		    COLUMN(grid_row, "cell_mm", cell_mm, .optional = true),
		    COLUMN(grid_row, "bound_mm", bound_mm, .optional = true),
		    COLUMN(grid_row, "reach_mm", reach_mm),
		    COLUMN(grid_row, "depth_error_mm", depth_mm),
		    COLUMN(grid_row, "normal_error_rad", normal_rad),
		    COLUMN(grid_row, "force_error_N", force_N),
		    COLUMN(grid_row, "size_kB", kB, .optional = true),
		    QUANTILES(grid_row, "ns", time), COLUMN(grid_row, "failed", failed)},
	.metrics = {METRIC(TIME, grid_row, time, "ns", "{name} of heights, {wanted_mm}"),
		    METRIC(EXACT, grid_row, force_N, "N",
			   "error of heights, {name} {wanted_mm}")},
};

/* The top of the sphere, as a sheet. */
static struct memory_file cap(void)
{
	struct memory_file file = memory_file_begin("cap");
	const int side = CELLS + 1;

	for (int k = 0; k < side * side; k++) {
		double x = HALF_MM * (2.0 * (k % side) / CELLS - 1);
		double y = HALF_MM * (2.0 * (k / side) / CELLS - 1);

		fprintf(file.file, "v %.9f %.9f %.9f\n", x, y,
			sqrt(RADIUS_MM * RADIUS_MM - x * x - y * y) - RADIUS_MM);
	}
	for (int k = 0; k < CELLS * CELLS; k++) {
		int a = k / CELLS * side + k % CELLS + 1;

		fprintf(file.file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a,
			a + side + 1, a + side);
	}
	memory_file_written(&file);
	return file;
}

/* In off the top, and round: 3 mm deep, 24 mm to and fro. */
static void place(double t_s, double p[3])
{
	double n[3] = {0.2 * sin(2 * M_PI * 0.9 * t_s) + 0.05,
		       0.04 * sin(2 * M_PI * 1.7 * t_s), 1};
	double out_mm = 1 - 4 * pow(sin(M_PI * 0.5 * t_s), 2);

	v3_copy(p, (double[3]){0, 0, -RADIUS_MM});
	v3_add(p, p, (RADIUS_MM + out_mm) / v3_length(n), n);
}

/* Depth and normal at all places of the way; errors where it is in the tissue and in reach. */
static void go_over(struct grid_row *row, bool errors)
{
	struct incise_proxy proxy;

	incise_proxy_init(&proxy, row->mesh, LEAVE_MM);
	for (int k = 0; k < PLACES; k++) {
		struct incise_fixed_spot spot = {.depth = 0};
		double p[3], n[3], out[3], force[3], depth_mm, off_mm;
		int32_t at[3];

		place(k * PERIOD_S, p);
		for (int i = 0; i < 3; i++)
			at[i] = (int32_t)lrint(ldexp(p[i], 16));
		if (row->wanted_mm > 0)
			incise_fixed_grid_nearest(&row->grid, at, &spot);
		else
			incise_proxy_move(&proxy, p);
		if (!errors)
			continue;
		v3_add(out, p, RADIUS_MM, (const double[3]){0, 0, 1});
		off_mm = RADIUS_MM - v3_length(out);
		if (off_mm < DEEP_MM || off_mm > row->reach_mm)
			continue;
		v3_unit(out, out, 0);
		v3_copy(n, proxy.touch.normal);
		depth_mm = proxy.touch.depth_mm;
		if (row->wanted_mm > 0) {
			depth_mm = ldexp(spot.depth, -16);
			for (int i = 0; i < 3; i++)
				n[i] = ldexp(spot.normal[i], -30);
		}
		for (int i = 0; i < 3; i++)
			force[i] = K_N_mm * (depth_mm * n[i] - off_mm * out[i]);
		v3_sub(out, n, out);
		row->depth_mm = fmax(row->depth_mm, fabs(depth_mm - off_mm));
		row->normal_rad = fmax(row->normal_rad, v3_length(out));
		row->force_N = fmax(row->force_N, v3_length(force));
	}
}

static void run_places(void *context)
{
	go_over(context, false);
}

static void prepare_grid(struct grid_row *row, const struct incise_surface *mesh)
{
	struct incise_heights *h = &row->heights;
	struct incise_error err = {0};
	uint32_t bytes;

	row->mesh = mesh;
	row->reach_mm = REACH_MM;
	if (row->wanted_mm > 0) {
		if (incise_heights_make(mesh, (const double[3]){0, 0, 1}, LEAVE_MM,
					REACH_MM, row->wanted_mm, h, &err))
			cli_fail_with(&err);
		bytes = 4 * (uint32_t)h->frame.columns * (uint32_t)h->frame.rows;
		row->kB = bytes * 1e-3;
		row->cell_mm = ldexp(1, h->frame.cell_shift - 16);
		row->bound_mm = h->depth_bound_mm;
		row->reach_mm = ldexp(h->frame.reach, -16);
		if (incise_fixed_grid_open(&row->grid, &h->frame, h->height, bytes))
			cli_fail("heights: a grid is not valid");
		if (row->bound_mm > row->wanted_mm)
			snprintf(
				row->failed, sizeof(row->failed),
				"no cell is within it: the bound is %.2g mm, of cells of "
				"%.2g mm",
				row->bound_mm, row->cell_mm);
	}
	go_over(row, true);
}

static void measure_heights(struct bench_run *run)
{
	const struct incise_tracker_info tracker = {.rate_hz = 1000};
	struct memory_file mesh = cap(), file = memory_file_begin("cap.scene");
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan;
	int n = run->quick ? N(grids) - 2 : N(grids);

	fprintf(file.file,
		"surface = { kind = \"mesh\"; file = \"%s\"; };\n"
		"tissue = { reaction_N_mm = 0.001; };\narithmetic = \"double\";\n",
		mesh.path);
	memory_file_written(&file);
	scene = cli_require(incise_scene_load(file.path, NULL, &err), &err);
	plan = cli_require(incise_plan_new_fed(scene, &tracker, &err), &err);
	for (int i = 0; i < n; i++)
		prepare_grid(&grids[i], incise_plan_surface(plan));
	bench_times(&grid_table, grids, n, run_places, PLACES, REPEATS(run));
	bench_rows(run, &grid_table, grids, n);
	for (int i = 0; i < n; i++)
		incise_heights_free(&grids[i].heights);
	incise_plan_free(plan);
	incise_scene_free(scene);
	fclose(mesh.file);
	fclose(file.file);
}

/* --- trackers ----------------------------------------------------------------------------- */

#define TRACKED_TICKS 4000
#define BEGIN_TICKS 500
#define TRACKED_MM 0.02 /* of noise, sd */

/* The first of them for a quick run. */
static struct tracker_row {
	double rate_hz, latency_ms, rms_mm, most_mm, held_mm;
	struct harness_time time; /* of a tick, with its share of the poses */
} trackers[] = {{120, 4.2}, {1000, 4.2}, {1000, 20}, {1000, 1},
		{240, 4.2}, {120, 20},	 {60, 4.2}};
#define QUICK_TRACKERS 3

static const struct bench_table tracker_table = {
	.key = "trackers",
	.row_bytes = sizeof(struct tracker_row),
	.columns = {COLUMN(tracker_row, "rate_hz", rate_hz),
		    COLUMN(tracker_row, "latency_ms", latency_ms),
		    COLUMN(tracker_row, "held_rms_mm", held_mm),
		    COLUMN(tracker_row, "rms_error_mm", rms_mm),
		    COLUMN(tracker_row, "max_error_mm", most_mm),
		    QUANTILES(tracker_row, "ns", time)},
	.metrics = {METRIC(TIME, tracker_row, time, "ns",
			   "predictor at {rate_hz} Hz, {latency_ms} ms"),
		    METRIC(EXACT, tracker_row, rms_mm, "mm",
			   "error of the predictor at {rate_hz} Hz, {latency_ms} ms")},
};

/* A stroke of 40 mm with a tremor. */
static double way_mm(double t_s)
{
	return 20 * sin(2 * M_PI * 0.9 * t_s) + 0.1 * sin(2 * M_PI * 9 * t_s);
}

/* Poses come as they are due; @miss: of each tick, with prediction and with none. */
static void track(const struct tracker_row *row, double (*miss)[2])
{
	const struct incise_tracker_info info = {
		.rate_hz = row->rate_hz, .latency_ns = llround(row->latency_ms * 1e6)};
	struct incise_tracker_sample sample = {.status = ' ', .quaternion = {1}};
	struct incise_predict predict;
	double shown[3], speed[3], attitude[4], taken_s = 0;
	int64_t begin_ns = INCISE_NS_PER_S;
	uint64_t next = 0;

	incise_predict_init(&predict, &info, 0);
	for (int k = 0; k < TRACKED_TICKS; k++) {
		double now_s = k * PERIOD_S, truth_mm = miss ? way_mm(now_s) : 0;

		for (; taken_s + row->latency_ms * 1e-3 <= now_s;
		     taken_s = (double)++next / row->rate_hz) {
			sample.t_ns = begin_ns + info.latency_ns + llround(taken_s * 1e9);
			sample.position_mm[0] = way_mm(taken_s);
			sample.position_mm[0] +=
				TRACKED_MM * incise_random_normal(1, next);
			incise_predict_add(&predict, &sample);
		}
		incise_predict_at(&predict, begin_ns + llround(now_s * 1e9), shown, speed,
				  attitude);
		if (miss) {
			miss[k][0] = shown[0] - truth_mm;
			miss[k][1] = sample.position_mm[0] - truth_mm;
		}
	}
}

static void run_track(void *row)
{
	track(row, NULL);
}

static void measure_tracker(struct tracker_row *row)
{
	static double miss[TRACKED_TICKS][2];
	double square = 0, held = 0;

	track(row, miss);
	for (int k = BEGIN_TICKS; k < TRACKED_TICKS; k++) {
		square += miss[k][0] * miss[k][0];
		held += miss[k][1] * miss[k][1];
		row->most_mm = fmax(row->most_mm, fabs(miss[k][0]));
	}
	row->rms_mm = sqrt(square / (TRACKED_TICKS - BEGIN_TICKS));
	row->held_mm = sqrt(held / (TRACKED_TICKS - BEGIN_TICKS));
}

static void measure_trackers(struct bench_run *run)
{
	int n = run->quick ? QUICK_TRACKERS : N(trackers);

	for (int i = 0; i < n; i++)
		measure_tracker(&trackers[i]);
	bench_times(&tracker_table, trackers, n, run_track, TRACKED_TICKS, REPEATS(run));
	bench_rows(run, &tracker_table, trackers, n);
}

static void run_settings(struct bench_run *run)
{
	measure_heights(run);
	measure_trackers(run);
}

const struct bench bench_program = {
	.name = "settings",
	.summary = "error against run time of what has a setting: heights of meshes, "
		   "trackers",
	.run = run_settings,
};
