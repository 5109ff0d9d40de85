// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error against run time of what has a setting.
 *
 *   heights    a mesh, and grids of its heights by the size of a cell, compared with the sphere that both
 *              stand for
 *   trackers   the predictor's error, and the stiffest wall, by rate, latency and damping
 *   squares    least squares of training by QR and by an exact Gram matrix, on rules that overlap more
 *              and more
 *   leans      the search for swings that do not end, by the ways to lean that it tries: what a closed
 *              loop of its own finds, with more leans, is the truth
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/plan.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "../../lib/learn/gram.h"
#include "../../lib/scene/heights.h"
#include "../../lib/scene/rest.h"
#include "../../lib/surface/surface.h"
#include "../../tools/bench/noise.h"
#include "../../tools/bench/stability.h"
#include "../../tools/cli/file.h"
#include "../../tools/cli/stopwatch.h"
#include "../wall_limit.h"
#include "program.h"

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
	.failed_after = 3,
	.columns = {COLUMN(grid_row, "name", name, "%14s", "surface"),
		    COLUMN(grid_row, "wanted_mm", wanted_mm, "%9g", "asked, mm",
			   .optional = true),
		    COLUMN(grid_row, "cell_mm", cell_mm, "%8.3g", "cell, mm",
			   .optional = true),
		    COLUMN(grid_row, "bound_mm", bound_mm, "%9.2g", "bound, mm",
			   .optional = true),
		    COLUMN(grid_row, "reach_mm", reach_mm, "%8.2g", "to, mm"),
		    COLUMN(grid_row, "depth_error_mm", depth_mm, "%9.2g", "depth, mm"),
		    COLUMN(grid_row, "normal_error_rad", normal_rad, "%11.2g",
			   "normal, rad"),
		    COLUMN(grid_row, "force_error_N", force_N, "%9.2g", "force, N"),
		    COLUMN(grid_row, "size_kB", kB, "%8.1f", "kB", .optional = true),
		    QUANTILES(grid_row, "ns", time, "%8.1f"),
		    COLUMN(grid_row, "failed", failed)},
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
	bench_text(
		run,
		"a mesh of a sphere of %g mm, %d triangles, and its grids of heights: cells "
		"by the bound that is asked for; largest errors, and run time of a place\n",
		RADIUS_MM, 2 * CELLS * CELLS);
	bench_table(run, &grid_table, grids, n);
	bench_text(run, "\n");
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
#define DAMPINGS 4

/* N s/mm of the device, and of the wall. */
static const double dampings[DAMPINGS][2] = {
	{0.005, 0}, {0.02, 0}, {0.1, 0}, {0.02, 0.005}};

/* The first of them for a quick run. */
static struct tracker_row {
	double rate_hz, latency_ms, rms_mm, most_mm, held_mm, limit[DAMPINGS];
	struct harness_time time; /* of a tick, with its share of the poses */
} trackers[] = {{120, 4.2}, {1000, 4.2}, {1000, 20}, {1000, 1},
		{240, 4.2}, {120, 20},	 {60, 4.2}};
#define QUICK_TRACKERS 3

static const struct bench_table tracker_table = {
	.key = "trackers",
	.row_bytes = sizeof(struct tracker_row),
	.columns = {COLUMN(tracker_row, "rate_hz", rate_hz, "%7g", "Hz"),
		    COLUMN(tracker_row, "latency_ms", latency_ms, "%6g", "ms"),
		    COLUMN(tracker_row, "held_rms_mm", held_mm, "%9.2g", "held, mm"),
		    COLUMN(tracker_row, "rms_error_mm", rms_mm, "%8.2g", "rms, mm"),
		    COLUMN(tracker_row, "max_error_mm", most_mm, "%8.2g", "most, mm"),
		    COLUMN(tracker_row, "limit_5_N_mm", limit[0], "%8.3g", "5"),
		    COLUMN(tracker_row, "limit_20_N_mm", limit[1], "%8.3g", "20"),
		    COLUMN(tracker_row, "limit_100_N_mm", limit[2], "%8.3g", "100"),
		    COLUMN(tracker_row, "limit_damped_N_mm", limit[3], "%8.3g", "20+5"),
		    QUANTILES(tracker_row, "ns", time, "%7.1f")},
	.metrics = {METRIC(TIME, tracker_row, time, "ns",
			   "predictor at {rate_hz} Hz, {latency_ms} ms"),
		    METRIC(EXACT, tracker_row, rms_mm, "mm",
			   "error of the predictor at {rate_hz} Hz, {latency_ms} ms"),
		    METRIC(EXACT, tracker_row, limit[1], "N/mm",
			   "stiffest wall at {rate_hz} Hz, {latency_ms} ms",
			   .more_is_better = true)},
};

/* A stroke of 40 mm with a tremor. */
static double way_mm(double t_s)
{
	return 20 * sin(2 * M_PI * 0.9 * t_s) + 0.1 * sin(2 * M_PI * 9 * t_s);
}

/* Poses come as they are due; @miss: of each tick, with prediction and with none. */
static struct incise_predict track(const struct tracker_row *row, double (*miss)[2])
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
	return predict;
}

static void run_track(void *row)
{
	track(row, NULL);
}

static void measure_tracker(struct tracker_row *row)
{
	static double miss[TRACKED_TICKS][2];
	const struct incise_predict predict = track(row, miss);
	double square = 0, held = 0;

	for (int k = BEGIN_TICKS; k < TRACKED_TICKS; k++) {
		square += miss[k][0] * miss[k][0];
		held += miss[k][1] * miss[k][1];
		row->most_mm = fmax(row->most_mm, fabs(miss[k][0]));
	}
	row->rms_mm = sqrt(square / (TRACKED_TICKS - BEGIN_TICKS));
	row->held_mm = sqrt(held / (TRACKED_TICKS - BEGIN_TICKS));
	for (int i = 0; i < DAMPINGS; i++) {
		const struct incise_haptic_device device = {.mass_kg = DEVICE_KG,
							    .damping_N_s_mm =
								    dampings[i][0],
							    .period_s = PERIOD_S};

		row->limit[i] = wall_limit(&device, &predict, dampings[i][1], 0);
	}
}

static void measure_trackers(struct bench_run *run)
{
	int n = run->quick ? QUICK_TRACKERS : N(trackers);

	for (int i = 0; i < n; i++)
		measure_tracker(&trackers[i]);
	bench_times(&tracker_table, trackers, n, run_track, TRACKED_TICKS, REPEATS(run));
	bench_text(
		run,
		"pose of now by the tracker: error of the last pose and of the predictor; "
		"stiffest wall, N/mm, on %g kg with 5, 20 and 100 mN s/mm, and with 20 and 5 of "
		"the wall\n",
		DEVICE_KG);
	bench_table(run, &tracker_table, trackers, n);
	bench_text(run, "\n");
}

/* --- least squares ------------------------------------------------------------------------ */

#define MFS 5
#define UNKNOWNS (2 * MFS)
#define PAIRS 200

/* Of membership functions, of the range. */
static const double widths[] = {0.125, 0.25, 0.5, 1, 2};

struct square_row {
	const char *name;
	double width, condition, unknowns, output; /* errors: relative, of the force */
	struct harness_time time;
	char failed[40];
	bool by_gram;
	double a[PAIRS][UNKNOWNS], t[PAIRS];
};

static const struct bench_table square_table = {
	.key = "squares",
	.row_bytes = sizeof(struct square_row),
	.failed_after = 3,
	.columns = {COLUMN(square_row, "name", name, "%12s", "method"),
		    COLUMN(square_row, "width", width, "%6g", "width"),
		    COLUMN(square_row, "condition", condition, "%10.2g", "condition"),
		    COLUMN(square_row, "unknowns_error", unknowns, "%10.2g", "unknowns"),
		    COLUMN(square_row, "max_error_N", output, "%10.2g", "force, N"),
		    QUANTILES(square_row, "us", time, "%7.1f", 1e-3),
		    COLUMN(square_row, "failed", failed)},
	.metrics = {METRIC(TIME, square_row, time, "us",
			   "least squares by {name}, width {width}")},
};

/* Strengths of Gaussians over 0 … 1, each times the input and times 1; the exact force. */
static double fill(double width, double at, double a[UNKNOWNS])
{
	double sum = 0;
	long double t = 0;

	for (int j = 1; j < UNKNOWNS; j += 2) {
		a[j] = exp(-0.5 * pow((at - (j / 2) / (MFS - 1.0)) / width, 2));
		sum += a[j];
	}
	for (int j = 0; j < UNKNOWNS; j++) {
		a[j] = j % 2 ? a[j] / sum : a[j + 1] / sum * at;
		t += (long double)a[j] * (1 + j) / UNKNOWNS;
	}
	return (double)t;
}

static int solve(const struct square_row *row, double *x, double *condition)
{
	struct incise_lsq *lsq = incise_lsq_new(UNKNOWNS, NULL);
	struct incise_gram *gram = incise_gram_new(UNKNOWNS + 2);
	bool by_gram = row->by_gram && !condition;
	int rc = 0;

	for (int i = 0; i < PAIRS; i++) {
		double *v = by_gram ? incise_gram_row(gram) : incise_lsq_row(lsq);

		memcpy(v, row->a[i], sizeof(row->a[i]));
		if (by_gram) {
			v[UNKNOWNS] = 1;
			v[UNKNOWNS + 1] = row->t[i];
			rc |= incise_gram_add(gram);
		} else {
			incise_lsq_add(lsq, row->t[i]);
		}
	}
	if (by_gram)
		rc |= incise_gram_factor(gram, 0, 1, lsq);
	rc |= condition ? incise_lsq_condition(lsq, condition)
			: incise_lsq_solve(lsq, NULL, x);
	incise_gram_free(gram);
	incise_lsq_free(lsq);
	return rc;
}

static void run_squares(void *row)
{
	double x[UNKNOWNS];

	solve(row, x, NULL);
}

static void measure_square(struct square_row *row)
{
	double x[UNKNOWNS], a[UNKNOWNS], off = 0, all = 0;

	for (int i = 0; i < PAIRS; i++)
		row->t[i] = fill(row->width, (i + 0.5) / PAIRS, row->a[i]);
	solve(row, x, &row->condition);
	row->unknowns = row->output = NAN;
	if (solve(row, x, NULL)) {
		strcpy(row->failed, "singular to its roundings");
		return;
	}
	for (int j = 0; j < UNKNOWNS; j++) {
		off += pow(x[j] - (1.0 + j) / UNKNOWNS, 2);
		all += pow((1.0 + j) / UNKNOWNS, 2);
	}
	row->unknowns = sqrt(off / all);
	row->output = 0;
	for (int i = 0; i <= 1000; i++) {
		double miss = -fill(row->width, i * 1e-3, a);

		for (int j = 0; j < UNKNOWNS; j++)
			miss += a[j] * x[j];
		row->output = fmax(row->output, fabs(miss));
	}
}

static void measure_squares(struct bench_run *run)
{
	static struct square_row rows[2 * N(widths)];

	for (int i = 0; i < N(rows); i++) {
		rows[i].by_gram = i % 2;
		rows[i].name = i % 2 ? "Gram, exact" : "QR";
		rows[i].width = widths[i / 2];
		measure_square(&rows[i]);
	}
	bench_times(&square_table, rows, N(rows), run_squares, 1, REPEATS(run));
	bench_text(
		run,
		"least squares of training, %d pairs and %d rules: membership functions of a "
		"width, of the range; error of the unknowns, relative, and of the force\n",
		PAIRS, MFS);
	bench_table(run, &square_table, rows, N(rows));
	bench_text(run, "\n");
}

/* --- leans -------------------------------------------------------------------------------- */

#define WAYS 64
#define SCENES(run) ((run)->quick ? 3 : 60)
#define SCENES_MAX 60
#define SIZES(run) ((run)->quick ? 3 : 8) /* of the truth's leans, in each of its ways */
#define LITTLE 1e-3			  /* a gain that each device bears */
#define DAMPED_N_s_mm 1

/* A scene, and each way: of how many leans, whether it is guided, swings, and its time. */
struct searched {
	bool swings; /* in truth */
	struct {
		bool guided, swings;
		int runs;
		double ns;
	} way[WAYS];
};

/* All scenes, judged by a part of the ways. */
static struct lean_row {
	const char *name;
	int first;
	bool guided, free;
	double ways, runs; /* of a scene */
	int scenes, swing, missed, refused;
	struct harness_time time; /* of a search to its end */
} leans[] = {
	{"first way", 1, true, true}, {"first 2", 2, true, true},
	{"first 4", 4, true, true},   {"first 8", 8, true, true},
	{"first 16", 16, true, true}, {"guided", WAYS, true, false},
	{"free", WAYS, false, true},  {"all", WAYS, true, true},
};

static const struct bench_table lean_table = {
	.key = "leans",
	.row_bytes = sizeof(struct lean_row),
	.columns = {COLUMN(lean_row, "name", name, "%12s", "ways"),
		    COLUMN(lean_row, "ways", ways, "%7.1f", "ways"),
		    COLUMN(lean_row, "leans", runs, "%7.1f", "leans"),
		    COLUMN(lean_row, "scenes", scenes, "%7.0f", "scenes"),
		    COLUMN(lean_row, "swing", swing, "%7.0f", "swing"),
		    COLUMN(lean_row, "missed", missed, "%7.0f", "missed"),
		    COLUMN(lean_row, "refused", refused, "%8.0f", "too much"),
		    QUANTILES(lean_row, "ms", time, "%8.1f", 1e-6)},
};

/* A size between two, as many of each. */
static double sized(uint64_t *seed, double low, double high)
{
	return low * pow(high / low, lcg_uniform(seed));
}

static struct lean_case draw_case(uint64_t *seed)
{
	return (struct lean_case){
		.shape = (int)incise_random_draw(seed, LEAN_SHAPES),
		.force = (int)incise_random_draw(seed, LEAN_FORCES),
		.loop = {.mass_kg = sized(seed, 0.03, 0.2),
			 .damping_N_s_mm = sized(seed, 0.005, 0.05),
			 .tracker_hz = sized(seed, 60, 1000),
			 .latency_s = sized(seed, 1e-3, 20e-3),
			 .late_ticks = (int)incise_random_draw(seed, 6)},
	};
}

static struct incise_plan *plan_of(const struct lean_case *is, double gain,
				   double damping_N_s_mm, struct incise_scene **scene)
{
	struct incise_error err = {0};

	return cli_require(lean_plan(is, gain, damping_N_s_mm, scene, &err), &err);
}

/* A gain below that with which a flat wall swings: what swings then is the search's to find. */
static double near_gain(const struct lean_case *is, uint64_t *seed)
{
	const struct incise_tracker_info tracker = closed_loop_tracker(&is->loop);
	double gain = sized(seed, 0.5, 1), most;
	struct incise_plan_stability s;
	struct incise_predict predict;
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(is, LITTLE, is->loop.damping_N_s_mm, &scene);

	incise_plan_stability(plan, &s);
	incise_plan_free(plan);
	incise_scene_free(scene);
	incise_predict_init(&predict, &tracker, 0);
	most = wall_limit(&s.device, &predict, 0, is->loop.late_ticks) / s.stiffness_N_mm;
	while (!wall_rests(&s.device, &predict, most * s.stiffness_N_mm,
			   most * s.damping_N_s_mm, is->loop.late_ticks))
		most *= 0.9;
	return gain * LITTLE * most;
}

/* Run each way alone. The time of none, for the noise of one that rests, is not the way's. */
static bool search_scene(const struct lean_case *is, double gain, int sizes,
			 struct searched *to)
{
	struct incise_tracker_info tracker = closed_loop_tracker(&is->loop);
	struct incise_rest_trial trial = {gain, is->loop.damping_N_s_mm, WAYS};
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(is, gain, DAMPED_N_s_mm, &scene);
	struct incise_rest rest;
	struct lean_end end;
	double none_ns = 0;

	for (; trial.way >= 0; trial.way--) {
		double begin = stopwatch_ns(), ns;

		if (incise_plan_rest(plan, &tracker, &trial, &rest))
			cli_fail("no memory");
		ns = stopwatch_ns() - begin - rest.rests * none_ns;
		if (trial.way == WAYS)
			none_ns = ns;
		else
			to->way[trial.way] = (typeof(*to->way)){
				rest.worst.guided, !rest.rests, rest.runs, ns};
	}
	lean_all(plan, is, sizes, true, &end);
	to->swings = end.swing_mm > CLOSED_LOOP_SWING_MM;
	incise_plan_free(plan);
	incise_scene_free(scene);
	return !isnan(end.swing_mm);
}

static void sum_up(struct lean_row *row, const struct searched *all, int n)
{
	double ns[SCENES_MAX] = {0};

	row->scenes = n;
	for (int s = 0; s < n; s++) {
		bool swings = false;
		int ways = 0;

		for (int i = 0; i < WAYS && ways < row->first; i++) {
			const typeof(*all->way) *way = &all[s].way[i];

			if (!way->runs || !(way->guided ? row->guided : row->free))
				continue;
			ways++;
			swings |= way->swings;
			row->runs += (double)way->runs / n;
			ns[s] += way->ns;
		}
		row->ways += (double)ways / n;
		row->swing += all[s].swings;
		row->missed += all[s].swings && !swings;
		row->refused += !all[s].swings && swings;
	}
	harness_spread(ns, n, &row->time.ns);
}

static void measure_leans(struct bench_run *run)
{
	static struct searched all[SCENES_MAX];
	int n = 0, left = 0;
	uint64_t seed = 1;

	lean_files();
	while (n < SCENES(run) && !cli_stop) {
		struct lean_case is = draw_case(&seed);

		cli_progress("leans: %d of %d", n, SCENES(run));
		if (search_scene(&is, near_gain(&is, &seed), SIZES(run), &all[n]))
			n++;
		else
			left++;
	}
	cli_progress_end();
	for (int i = 0; i < N(leans); i++)
		sum_up(&leans[i], all, n);
	bench_text(
		run,
		"search for swings that do not end, of %d random scenes that the linear "
		"check accepts (%d more had no lean that stays): ways to lean, and what %d leans "
		"of a loop of its own find; too much: refused, though they rest there\n",
		n, left, SIZES(run) * LEAN_WAYS);
	bench_table(run, &lean_table, leans, N(leans));
}

static void run_settings(struct bench_run *run)
{
	run->tabs = false; /* its tables have headings */
	measure_heights(run);
	measure_trackers(run);
	measure_squares(run);
	measure_leans(run);
}

const struct bench bench_program = {
	.name = "settings",
	.summary =
		"error against run time of what has a setting: heights of meshes, trackers, "
		"least squares, leans of the search for swings",
	.run = run_settings,
};
