// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench precision: error against run time of paper 2's forces, in integers and in floating
 * point, by the proxy of meshes that are finer and finer, and with normals averaged over more and more
 * ticks. Truth is the paper's formula on the sphere that all of them stand for, in long double.
 *
 *   F = Kn d n - Kx ((P - P0)·s) s        P0: where the tool went in, s: the blade's side
 *
 * A mean of normals is late, and smooths the effect of a mesh's facets on the force's direction:
 *
 *   lag       the time by which directions e that are off are late of what turns: e = -lag dn/dt
 *   ripple    of e, from tick to tick
 */
#include <stdio.h>
#include <incise/plan.h>
#include "../../lib/base/vector.h"
#include "../cli/file.h"
#include "bench.h"

#define RADIUS_MM 55.0 /* a neck's */
#define KN_N_mm 0.14
#define KX_N_mm 0.17
#define DEEP_MM 0.5 /* a mesh is in contact, too */
#define TICKS 4000
#define AIR_TICKS 500 /* until the force may start */
#define RATE_HZ 1000.0
#define REPEATS(run) ((run)->quick ? 5 : 31)

struct error_row {
	const char *name;
	int cells; /* of the mesh, round the sphere; 0: a sphere */
	const char *arithmetic;
	int average_ticks;

	int triangles;
	double rms_N, largest_N, contact; /* over ticks in contact */
	double lag_ms, ripple_mrad;	  /* of the normal */
	struct harness_time time;	  /* of a tick */
	struct incise_scene *scene;
	struct incise_plan *plan;
	double begin_s; /* a plan's time goes on */
};

static struct error_row rows[] = {
	{"sphere, double", 0, "double", 1}, {"sphere, fixed", 0, "fixed", 1},
	{"mesh", 24, "double", 1},	    {"mesh", 48, "double", 1},
	{"mesh", 48, "double", 2},	    {"mesh", 48, "double", 4},
	{"mesh", 48, "double", 8},	    {"mesh", 48, "double", 16},
	{"mesh", 48, "double", 32},	    {"mesh", 48, "double", 64},
	{"mesh", 96, "double", 1},	    {"mesh", 192, "double", 1},
	{"mesh", 384, "double", 1},
};

const struct bench_table precision_force_table = {
	.key = "forces",
	.row_bytes = sizeof(struct error_row),
	.columns = {COLUMN(error_row, "name", name, "%14s", "forces"),
		    COLUMN(error_row, "arithmetic", arithmetic),
		    COLUMN(error_row, "triangles", triangles, "%9.0f", "triangles",
			   .optional = true),
		    COLUMN(error_row, "average_ticks", average_ticks, "%7.0f", "average"),
		    COLUMN(error_row, "rms_error_N", rms_N, "%9.2g", "rms, N"),
		    COLUMN(error_row, "max_error_N", largest_N, "%10.2g", "largest, N"),
		    COLUMN(error_row, "lag_ms", lag_ms, "%8.3g", "lag, ms"),
		    COLUMN(error_row, "ripple_mrad", ripple_mrad, "%12.3g",
			   "ripple, mrad"),
		    COLUMN(error_row, "contact", contact),
		    QUANTILES(error_row, "ns", time, "%8.1f")},
	.metrics = {METRIC(TIME, error_row, time, "ns",
			   "tick of forces, {name} {triangles} {average_ticks}"),
		    METRIC(EXACT, error_row, rms_N, "N",
			   "error of forces, {name} {triangles} {average_ticks}"),
		    METRIC(EXACT, error_row, lag_ms, "ms", "lag of {average_ticks} ticks",
			   "triangles=2208"),
		    METRIC(EXACT, error_row, ripple_mrad, "mrad",
			   "ripple of {average_ticks} ticks", "triangles=2208")},
};

/* A sphere below the origin, of cells by degrees of latitude and longitude. */
static struct memory_file sphere_of(int cells, int *triangles)
{
	struct memory_file file = memory_file_begin("sphere");
	int rings = cells / 2;

	fprintf(file.file, "v 0 0 0\n");
	for (int r = 1; r < rings; r++)
		for (int c = 0; c < cells; c++) {
			double a = M_PI * r / rings, b = 2 * M_PI * c / cells;

			fprintf(file.file, "v %.9f %.9f %.9f\n",
				RADIUS_MM * sin(a) * cos(b), RADIUS_MM * sin(a) * sin(b),
				RADIUS_MM * (cos(a) - 1));
		}
	fprintf(file.file, "v 0 0 %.9f\n", -2 * RADIUS_MM);
	for (int c = 0; c < cells; c++) {
		int next = (c + 1) % cells, last = (rings - 2) * cells + 2;

		fprintf(file.file, "f 1 %d %d\n", c + 2, next + 2);
		for (int r = 0; r < rings - 2; r++)
			fprintf(file.file, "f %d %d %d\nf %d %d %d\n", r * cells + 2 + c,
				(r + 1) * cells + 2 + c, (r + 1) * cells + 2 + next,
				r * cells + 2 + c, (r + 1) * cells + 2 + next,
				r * cells + 2 + next);
		fprintf(file.file, "f %d %d %d\n", last + next, last + c,
			(rings - 1) * cells + 2);
	}
	*triangles = 2 * cells * (rings - 1);
	memory_file_written(&file);
	return file;
}

/* The blade goes in off the top, and round: 3 mm deep, 24 mm to and fro, at up to 75 mm/s. */
static void place_precision_stroke(double t_s, double p[3])
{
	double along = 0.2 * sin(2 * M_PI * 0.9 * t_s) + 0.05;
	double across = 0.04 * sin(2 * M_PI * 1.7 * t_s);
	double out_mm = 1 - 4 * pow(sin(M_PI * 0.5 * t_s), 2);
	double n[3] = {along, across, 1};

	v3_copy(p, (double[3]){0, 0, -RADIUS_MM});
	v3_add(p, p, (RADIUS_MM + out_mm) / v3_length(n), n);
}

static void tick_at(struct error_row *row, double t_s, const double p[3],
		    struct incise_tick *tick)
{
	struct incise_tracker_sample sample = {.status = ' ', .quaternion = {1}};

	sample.t_ns = INCISE_NS_PER_S + llround((row->begin_s + t_s) * INCISE_NS_PER_S);
	v3_copy(sample.position_mm, p);
	if (incise_plan_feed(row->plan, &sample, 1) != 1 ||
	    incise_plan_tick(row->plan, sample.t_ns, tick))
		cli_fail("forces: a plan does not take a tick");
}

/* Where the way from one place to the next enters the sphere, from its middle. */
static void enters(const double from[3], const double to[3], long double at[3])
{
	long double a = 0, b = 0, c = -(long double)RADIUS_MM * RADIUS_MM, share;

	for (int i = 0; i < 3; i++) {
		long double f = from[i] + (i == 2 ? RADIUS_MM : 0), way = to[i] - from[i];

		a += way * way;
		b += f * way;
		c += f * f;
	}
	share = (-b - sqrtl(b * b - a * c)) / a;
	for (int i = 0; i < 3; i++)
		at[i] = from[i] + (i == 2 ? RADIUS_MM : 0) + share * (to[i] - from[i]);
}

static void measure_error(struct error_row *row)
{
	const double side[3] = {0, 1, 0};
	double far[3] = {0, 0, 50}, was[3], sum = 0;
	double n_was[3], off_was[3], along = 0, turned = 0, ripple = 0;
	long double p0[3] = {0};
	struct incise_tick tick;
	bool inside = false, before, deep = false;

	for (int k = 0; k < AIR_TICKS; k++)
		tick_at(row, k / RATE_HZ, far, &tick);
	row->begin_s += AIR_TICKS / RATE_HZ;
	v3_copy(was, tick.tool_mm);
	for (int k = 0; k < TICKS; k++) {
		long double r = 0, off = 0, error = 0, q[3];
		double p[3];

		before = deep;
		place_precision_stroke(k / RATE_HZ, p);
		tick_at(row, k / RATE_HZ, p, &tick);
		for (int i = 0; i < 3; i++) {
			q[i] = tick.tool_mm[i] + (i == 2 ? RADIUS_MM : 0);
			r += q[i] * q[i];
		}
		r = sqrtl(r);
		if (r < RADIUS_MM && !inside)
			enters(was, tick.tool_mm, p0);
		inside = r < RADIUS_MM;
		deep = r < RADIUS_MM - DEEP_MM;
		v3_copy(was, tick.tool_mm);
		if (!inside)
			continue;
		for (int i = 0; i < 3; i++)
			off += side[i] * (q[i] - p0[i]);
		for (int i = 0; i < 3; i++) {
			long double truth = KN_N_mm * (RADIUS_MM - r) * q[i] / r -
					    KX_N_mm * off * side[i];
			long double e = tick.command_N[i] - truth;

			double n = (double)(q[i] / r), n_off = tick.normal[i] - n;

			error += e * e;
			if (before && deep) {
				along -= n_off * (n - n_was[i]);
				turned += (n - n_was[i]) * (n - n_was[i]);
				ripple += (n_off - off_was[i]) * (n_off - off_was[i]);
			}
			n_was[i] = n;
			off_was[i] = n_off;
		}
		row->contact++;
		sum += (double)error;
		row->largest_N = fmax(row->largest_N, (double)sqrtl(error));
	}
	row->begin_s += TICKS / RATE_HZ;
	row->rms_N = sqrt(sum / row->contact);
	row->lag_ms = 1e3 * along / turned / RATE_HZ;
	row->ripple_mrad = 1e3 * sqrt(ripple / row->contact);
}

static void run_precision_forces_timed(void *context)
{
	struct error_row *row = context;
	struct incise_tick tick;
	double p[3];

	for (int k = 0; k < TICKS; k++) {
		place_precision_stroke(k / RATE_HZ, p);
		tick_at(row, k / RATE_HZ, p, &tick);
	}
	row->begin_s += TICKS / RATE_HZ;
}

static void prepare(struct error_row *row)
{
	const struct incise_tracker_info tracker = {.rate_hz = RATE_HZ};
	struct memory_file scene = memory_file_begin("forces.scene"), mesh = {0};
	struct incise_error err = {0};

	fprintf(scene.file, "arithmetic = \"%s\";\n", row->arithmetic);
	if (row->cells) {
		mesh = sphere_of(row->cells, &row->triangles);
		fprintf(scene.file, "surface = { kind = \"mesh\"; file = \"%s\"; };\n",
			mesh.path);
	} else {
		fprintf(scene.file,
			"surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, %.1f]; "
			"radius_mm = %.1f; };\n",
			-RADIUS_MM, RADIUS_MM);
	}
	/* Beside the blade's side nothing limits the force here. */
	fprintf(scene.file,
		"tissue = { reaction_N_mm = %.2f; plane_N_mm = %.2f; };\n"
		"effects = { average_ticks = %d; };\ntool = { side = [0.0, 1.0, 0.0]; };\n"
		"limits = { force_N = 20.0; slew_N_s = 100000.0; };\n",
		KN_N_mm, KX_N_mm, row->average_ticks);
	memory_file_written(&scene);
	row->scene = cli_require(incise_scene_load(scene.path, NULL, &err), &err);
	row->plan = cli_require(incise_plan_new_fed(row->scene, &tracker, &err), &err);
	fclose(scene.file);
	if (mesh.file)
		fclose(mesh.file);
}

void precision_forces(struct bench_run *run)
{
	int n = run->quick ? N(rows) - 2 : N(rows);

	for (int i = 0; i < n; i++) {
		cli_progress("forces: %d of %d", i + 1, n);
		prepare(&rows[i]);
		measure_error(&rows[i]);
	}
	bench_times(&precision_force_table, rows, n, run_precision_forces_timed, TICKS,
		    REPEATS(run));
	bench_text(run,
		   "force laws of Bhasin et al. (2005) on a sphere of %g mm: error, and "
		   "run time of a tick with its pose\n",
		   RADIUS_MM);
	bench_table(run, &precision_force_table, rows, n);
	bench_text(run, "\n");
	for (int i = 0; i < n; i++) {
		incise_plan_free(rows[i].plan);
		incise_scene_free(rows[i].scene);
	}
}
