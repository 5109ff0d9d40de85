// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench stability: error against run time of integrators of a mass on a spring from soft
 * to hard, with a damper, m x'' + b x' + K x = f. Every one is listed, those that diverge too.
 *
 *   force  2 N          ┌───────────
 *          1 N  ┌───────┘             each for a second, at 1 kHz
 *            0 ─┘
 */
#include <string.h>
#include "../../lib/control/plant.h"
#include "bench.h"

#define MM_PER_M 1000
#define DAMPING_RATIO 0.1 /* to the critical one */
#define TICK_S PERIOD_S
#define TICKS 2000
#define REPEATS 49
#define QUICK_REPEATS 5
#define ROWS_MAX 256
/* Least duration of a timed run: short ones need no whole second of motion. */
#define TIMED_STEPS 4000
/* Beyond so many times the truth it is not coming back. */
#define DIVERGED 1e6
/* An exact integrator is exact to the roundings of 1000 steps with the force held, and to the
 * roundings of a tick's angle: 140 rad at 1e9 N/m. */
#define EXACT 1e-9

/* Times in s, x in mm. */
struct integration {
	double step_s;
	double x, v;
	double rate, omega2, push; /* b/m, K/m, and mm/s² of a N */
	double zoh[2][3];
	struct incise_plant plant;
};

static double acceleration(const struct integration *in, double x, double v, double f)
{
	return in->push * f - in->omega2 * x - in->rate * v;
}

static void explicit_euler(struct integration *in, double f)
{
	double a = acceleration(in, in->x, in->v, f);

	in->x += in->step_s * in->v;
	in->v += in->step_s * a;
}

static void semi_implicit_euler(struct integration *in, double f)
{
	in->v += in->step_s * acceleration(in, in->x, in->v, f);
	in->x += in->step_s * in->v;
}

static void implicit_euler(struct integration *in, double f)
{
	double h = in->step_s;

	in->v = (in->v + h * (in->push * f - in->omega2 * in->x)) /
		(1 + h * in->rate + h * h * in->omega2);
	in->x += h * in->v;
}

static void trapezoid(struct integration *in, double f)
{
	double h = in->step_s, was = in->v;
	double half = h * in->rate / 2 + h * h * in->omega2 / 4;

	in->v = (in->v * (1 - half) + h * (in->push * f - in->omega2 * in->x)) /
		(1 + half);
	in->x += h * (was + in->v) / 2;
}

static void rk4(struct integration *in, double f)
{
	double h = in->step_s, x = in->x, v = in->v;
	double a1 = acceleration(in, x, v, f), v2 = v + h / 2 * a1;
	double a2 = acceleration(in, x + h / 2 * v, v2, f), v3 = v + h / 2 * a2;
	double a3 = acceleration(in, x + h / 2 * v2, v3, f), v4 = v + h * a3;
	double a4 = acceleration(in, x + h * v3, v4, f);

	in->x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
	in->v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
}

/* A matrix, computed once. */
static void exact_zoh(struct integration *in, double f)
{
	double x = in->x, v = in->v;

	in->x = in->zoh[0][0] * x + in->zoh[0][1] * v + in->zoh[0][2] * f;
	in->v = in->zoh[1][0] * x + in->zoh[1][1] * v + in->zoh[1][2] * f;
}

/* The library's, which looks for events too. */
static void plant(struct integration *in, double f)
{
	incise_plant_step(&in->plant, f, in->step_s);
	in->x = in->plant.position_mm;
	in->v = in->plant.velocity_mm_s;
}

static const struct integrator {
	const char *name;
	void (*step)(struct integration *in, double force_N);
	bool exact;
} integrators[] = {
	{"explicit_euler", explicit_euler, false},
	{"semi_implicit_euler", semi_implicit_euler, false},
	{"implicit_euler", implicit_euler, false},
	{"trapezoid", trapezoid, false},
	{"rk4", rk4, false},
	{"exact_zoh", exact_zoh, true},
	{"plant", plant, true},
};

struct row {
	const char *name;
	const struct integrator *integrator;
	double K_N_m, step_s;
	/* Error of the places at whole milliseconds, as part of the largest true one. */
	double max_error, rms_error;
	struct harness_time time; /* for a ms of motion */
	double ns_per_step;
	char failed[12];
};

static struct row rows[ROWS_MAX];
static int n_rows;

/* At rest. */
static struct integration start_integration(const struct row *row)
{
	double omega2 = row->K_N_m / DEVICE_KG;
	struct integration in = {
		.step_s = row->step_s,
		.rate = 2 * DAMPING_RATIO * sqrt(omega2),
		.omega2 = omega2,
		.push = MM_PER_M / DEVICE_KG,
		.plant = {.mass_kg = DEVICE_KG,
			  .wall_N_mm = row->K_N_m / MM_PER_M,
			  .tied = true},
	};

	in.plant.damping_N_s_mm = in.rate * DEVICE_KG / MM_PER_M;
	/* A step's answer to a unit of place, of speed and of force. */
	for (int k = 0; k < 3; k++) {
		struct incise_plant unit = in.plant;

		unit.position_mm = k == 0;
		unit.velocity_mm_s = k == 1;
		incise_plant_step(&unit, k == 2, row->step_s);
		in.zoh[0][k] = unit.position_mm;
		in.zoh[1][k] = unit.velocity_mm_s;
	}
	return in;
}

static double force(int tick)
{
	return tick < TICKS / 2 ? 1 : 2;
}

/* Places at the ends of all ticks, in long double and without steps; each part of the motion
 * from where its force began. */
static void true_places(double K_N_m, double *places)
{
	long double omega2 = (long double)K_N_m / DEVICE_KG;
	long double fade = DAMPING_RATIO * sqrtl(omega2);
	long double nu = sqrtl(omega2 - fade * fade), x = 0, v = 0, A = 0, B = 0;
	int since = 0;

	for (int k = 0; k < TICKS; k++) {
		long double rest = (long double)force(k) / K_N_m * MM_PER_M, t, c, s;

		if (!k || force(k) != force(k - 1)) {
			since = k;
			A = x - rest;
			B = (v + fade * A) / nu;
		}
		t = (k + 1 - since) * (long double)TICK_S;
		c = expl(-fade * t) * cosl(nu * t);
		s = expl(-fade * t) * sinl(nu * t);
		x = rest + A * c + B * s;
		v = (B * nu - A * fade) * c - (A * nu + B * fade) * s;
		places[k] = x;
	}
}

static int substeps_of(const struct row *row)
{
	return (int)lround(TICK_S / row->step_s);
}

static void integrate(const struct row *row, int ticks, double *places)
{
	struct integration in = start_integration(row);
	int substeps = substeps_of(row);

	for (int k = 0; k < ticks; k++) {
		double f = force(k);

		for (int i = 0; i < substeps; i++)
			row->integrator->step(&in, f);
		places[k] = in.x;
	}
}

static void measure_row(struct row *row, const double *truth)
{
	static double places[TICKS];
	double largest = 0, worst = 0, sum = 0;

	integrate(row, TICKS, places);
	for (int k = 0; k < TICKS; k++)
		largest = fmax(largest, fabs(truth[k]));
	for (int k = 0; k < TICKS; k++) {
		double off = fabs(places[k] - truth[k]) / largest;

		if (!(off < DIVERGED)) {
			strcpy(row->failed, "diverged");
			worst = sum = INFINITY;
			break;
		}
		worst = fmax(worst, off);
		sum += off * off;
	}
	row->max_error = worst;
	row->rms_error = sqrt(sum / TICKS);
}

static int timed_ticks(const struct row *row)
{
	int ticks = (TIMED_STEPS + substeps_of(row) - 1) / substeps_of(row);

	return ticks < TICKS ? ticks : TICKS;
}

static void run_stability_integrators_timed(void *context)
{
	static double places[TICKS];

	integrate(context, timed_ticks(context), places);
}

static void measure_times(int repeats)
{
	static struct harness_variant variants[ROWS_MAX];

	for (int i = 0; i < n_rows; i++)
		variants[i] =
			(struct harness_variant){.run = run_stability_integrators_timed,
						 .context = &rows[i],
						 .units = timed_ticks(&rows[i]),
						 .time = &rows[i].time};
	harness_times(variants, n_rows, repeats);
	for (struct row *row = rows; row < rows + n_rows; row++)
		row->ns_per_step = row->time.ns.median * row->step_s / TICK_S;
}

static void add_stability_integrators(const struct integrator *integrator, double K,
				      int substeps, const double *truth)
{
	struct row *row = &rows[n_rows++];

	if (n_rows > ROWS_MAX)
		cli_fail("integrators: more than %d rows", ROWS_MAX);
	*row = (struct row){.name = integrator->name,
			    .integrator = integrator,
			    .K_N_m = K,
			    .step_s = TICK_S / substeps};
	measure_row(row, truth);
}

/* Springs that smaller steps are tried at, too. */
static const double swept[] = {1e3, 1e5};

static void measure_stability_integrators(bool quick)
{
	static const double springs[] = {1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
	static double truth[TICKS];

	for (int i = 0; i < N(springs); i += quick ? 2 : 1) {
		true_places(springs[i], truth);
		for (int k = 0; k < N(integrators); k++)
			add_stability_integrators(&integrators[k], springs[i], 1, truth);
	}
	/* Work against precision: smaller and smaller steps. */
	for (int i = 0; i < N(swept); i++) {
		true_places(swept[i], truth);
		for (int k = 0; !integrators[k].exact; k++)
			for (int substeps = 2; substeps <= (quick ? 16 : 1024);
			     substeps *= quick ? 8 : 2)
				add_stability_integrators(&integrators[k], swept[i],
							  substeps, truth);
	}
	measure_times(quick ? QUICK_REPEATS : REPEATS);
}

static const struct bench_table stability_integrator_table = {
	.key = "integrators",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "integrator", name), COLUMN(row, "K_N_m", K_N_m),
		    COLUMN(row, "step_s", step_s), COLUMN(row, "max_error", max_error),
		    COLUMN(row, "rms_error", rms_error),
		    COLUMN(row, "ns_per_step", ns_per_step),
		    COLUMN(row, "ns_per_ms", time.ns.median),
		    COLUMN(row, "ns_per_ms_p5", time.ns.p5),
		    COLUMN(row, "ns_per_ms_p95", time.ns.p95),
		    COLUMN(row, "failed", failed)},
	/* The time of one spring holds for all. */
	.metrics = {METRIC(TIME, row, time, "ns", "{integrator} step",
			   "step_s=0.001,K_N_m=1000"),
		    METRIC(EXACT, row, max_error, "1",
			   "{integrator} largest error at {K_N_m} N/m",
			   "step_s=0.001,K_N_m=1000|100000")},
};

void stability_integrators(struct bench_run *run)
{
	int missed = 0;

	measure_stability_integrators(run->quick);
	bench_rows(run, &stability_integrator_table, rows, n_rows);
	for (int i = 0; i < n_rows; i++)
		missed += rows[i].integrator->exact && !(rows[i].max_error <= EXACT);
	if (missed)
		bench_fail(run,
			   "integrators: %d runs of the exact ones were not: please "
			   "report it",
			   missed);
}
