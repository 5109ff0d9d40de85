// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench stability: how stiff a virtual wall may be, simulated in time next to
 * theory; scenes under a leaning hand; error against run time of integrators of a stiff
 * spring. The device is light, in a loop of 1 kHz.
 */
#include <stdio.h>
#include <string.h>
#include <incise/model.h>
#include "../../lib/control/plant.h"
#include <incise/stability.h>
#include "bench.h"

#define N_S2_PER_MM_KG 1e-3		    /* 1 kg = 1 N s²/m */
#define DEVICE (DEVICE_KG * N_S2_PER_MM_KG) /* N s²/mm */

/* --- a row of a simulation next to theory --- */

#define PARAMS 4
#define RATIOS_MAX 160

struct ratio {
	double param[PARAMS];
	double simulated, theory; /* theory: the expected value, or the least allowed */
	bool at_least;

	double ratio; /* 1 where both find no limit */
	bool ok;
};

struct ratios {
	const struct experiment *experiment;
	struct ratio row[RATIOS_MAX];
	int n;
	struct bench_table table;
};

static void add(struct ratios *ratios, struct ratio row);

/* Whether a motion grows at a stiffness or amplitude. */
typedef bool (*grows_fn)(const void *context, double value);

/* The value from which on it grows, found by climbing from a small one and then halving the
 * interval; 0 where that one already grows. */
static double threshold(grows_fn grows, const void *context, double low, double most,
			double precision)
{
	double high = 2 * low;

	if (grows(context, low))
		return 0;
	for (; !grows(context, high); high *= 2) {
		if (high > most)
			return INFINITY;
		low = high;
	}
	while (high > low * (1 + precision)) {
		double middle = sqrt(low * high);

		if (grows(context, middle))
			high = middle;
		else
			low = middle;
	}
	return sqrt(low * high);
}

/* --- a sampled wall in time, in which no eigenvalue is computed ---
 *
 *   x_k ──▶ -K x_k - B (x_k - x_{k-1})/T ──▶ delay ticks ──▶ held for T ──▶ plant
 */

#define UNIT_N_s_mm (DEVICE / PERIOD_S)	   /* m/T */
#define UNIT_N_mm (UNIT_N_s_mm / PERIOD_S) /* m/T² */
#define WALL_DELAY_MAX 64

struct sampled_wall {
	struct incise_plant plant; /* the device, tied; no Coulomb friction */
	double damping_N_s_mm;	   /* of the wall, B */
	int delay;
};

/* A run: some time for fast fading, then two windows apart.
 *
 *   0      skip       window              gap              window
 *   ├────────────┼──╱‾‾‾‾‾‾‾╲──┼──────────────────────┼──╱‾‾‾‾‾‾‾╲──┤
 */
struct run {
	int skip, window, gap;
	double omega; /* angular frequency that the wall gives: x² + (v/ω)² is amplitude² */
};

static struct run plan(const struct sampled_wall *wall, double K_N_mm)
{
	double m = wall->plant.mass_kg * N_S2_PER_MM_KG, T = PERIOD_S;
	double delta = wall->plant.damping_N_s_mm * T / m;
	struct run run = {.omega = sqrt((K_N_mm + wall->plant.wall_N_mm) / m)};

	/* Some twelve swings, so that it does not matter where one begins. */
	run.window = fmax(400, fmin(10000, 12 * 2 * M_PI / (run.omega * T)));
	run.skip = run.window + 20 * wall->delay;
	/* A stiffness that is off by 1e-3 changes the growth by δ/2 × 1e-3 per tick. */
	run.gap = fmax(3000, fmin(20000, 20 / delta));
	return run;
}

static bool wall_grows(const void *context, double K_N_mm)
{
	const struct sampled_wall *wall = context;
	struct run run = plan(wall, K_N_mm);
	struct incise_plant plant = wall->plant;
	double past[WALL_DELAY_MAX + 2], sum[2] = {0}, T = PERIOD_S;
	int size = wall->delay + 2, late = run.skip + run.window + run.gap;

	/* Both a displacement and a push, so that no mode is left out. */
	plant.position_mm = 1;
	plant.velocity_mm_s = 0.3 * run.omega;
	for (int i = 0; i < size; i++)
		past[i] = plant.position_mm;
	for (int k = 0; k < late + run.window; k++) {
		double x = plant.position_mm, v = plant.velocity_mm_s / run.omega;
		double norm = x * x + v * v, seen, before;
		int since = k < late ? k - run.skip : k - late;

		if (norm > 1e24)
			return true;
		if (norm < 1e-24)
			return false;
		if (since >= 0 && since < run.window) {
			double weight = sin(M_PI * since / run.window);

			sum[k >= late] += weight * weight * norm;
		}
		past[k % size] = x;
		seen = past[(k + size - wall->delay) % size];
		before = past[(k + size - wall->delay - 1) % size];
		incise_plant_step(
			&plant,
			-K_N_mm * seen - wall->damping_N_s_mm * (seen - before) / T, T);
	}
	return sum[1] > sum[0];
}

static double wall_limit(const struct sampled_wall *wall)
{
	double unit = wall->plant.mass_kg * N_S2_PER_MM_KG / (PERIOD_S * PERIOD_S);

	return threshold(wall_grows, wall, 2e-5 * unit, 1e6 * unit, 1e-4);
}

static struct incise_haptic_device device(double bT_m, int delay)
{
	return (struct incise_haptic_device){.mass_kg = DEVICE_KG,
					     .damping_N_s_mm = bT_m * UNIT_N_s_mm,
					     .period_s = PERIOD_S,
					     .delay_ticks = delay};
}

static struct sampled_wall wall(double bT_m, double BT_m, int delay)
{
	return (struct sampled_wall){.plant = {.mass_kg = DEVICE_KG,
					       .damping_N_s_mm = bT_m * UNIT_N_s_mm},
				     .damping_N_s_mm = BT_m * UNIT_N_s_mm,
				     .delay = delay};
}

struct grid {
	double damping[8], wall[4];
	int delay[4];
	int n_dampings, n_walls, n_delays;
};

/* A wall alone on the device, over damping and delay. */
static void sweep(struct ratios *ratios, const struct grid *grid,
		  double (*theory)(const struct incise_haptic_device *, double))
{
	for (int d = 0; d < grid->n_delays; d++)
		for (int w = 0; w < grid->n_walls; w++)
			for (int b = 0; b < grid->n_dampings; b++) {
				double bT_m = grid->damping[b], BT_m = grid->wall[w];
				int delay = grid->delay[d];
				struct incise_haptic_device dev = device(bT_m, delay);
				struct sampled_wall sim = wall(bT_m, BT_m, delay);

				add(ratios,
				    (struct ratio){
					    .param = {bT_m, BT_m, delay},
					    .simulated = wall_limit(&sim) / UNIT_N_mm,
					    .theory = theory(&dev, BT_m * UNIT_N_s_mm) /
						      UNIT_N_mm});
			}
}

static void exact_limit(struct ratios *ratios, bool quick)
{
	static const struct grid full = {{0.001, 0.01, 0.1, 1, 3, 10},
					 {0, 0.1, 0.3},
					 {0, 1, 2, 5},
					 6,
					 3,
					 4},
				 few = {{0.01, 1, 10}, {0, 0.1}, {0, 2}, 3, 2, 2};

	sweep(ratios, quick ? &few : &full, incise_stability_limit);
}

/* The hand adds mass, so that little damping is left per mass, and a spring, so that the
 * whole swings at an angle per tick: a passive hand, and the worst of its kind. */
static double limit_in_hand(struct sampled_wall sim, double angle)
{
	double m;

	sim.plant.mass_kg = sim.plant.damping_N_s_mm * PERIOD_S / 0.01 / N_S2_PER_MM_KG;
	m = sim.plant.mass_kg * N_S2_PER_MM_KG;
	sim.plant.tied = true;
	sim.plant.wall_N_mm = m * (angle / PERIOD_S) * (angle / PERIOD_S);
	return wall_limit(&sim);
}

static void colgate(struct ratios *ratios, bool quick)
{
	static const struct {
		double BT_m;
		int delay;
		bool at_least; /* one mode of the hand does not reach the bound */
	} cases[] = {{0, 0, false}, {0, 2, false}, {-0.05, 0, false}, {0.05, 0, true},
		     {0, 1, false}, {0, 5, false}, {0.05, 2, true}};
	static const double angles[] = {0,   1, 3.141, 0.1, 0.3, 0.6,
					1.5, 2, 2.5,   2.8, 3,	 3.1};
	const double bT_m = 0.1;

	for (int i = 0; i < (quick ? 4 : N(cases)); i++) {
		double BT_m = cases[i].BT_m, lowest = INFINITY, at = 0;
		struct incise_haptic_device dev = device(bT_m, cases[i].delay);
		struct sampled_wall sim = wall(bT_m, BT_m, cases[i].delay);

		for (int k = 0; k < (quick ? 3 : N(angles)); k++) {
			double K = limit_in_hand(sim, angles[k]) / UNIT_N_mm;

			cli_progress("in a hand: %d, angle %g", i + 1, angles[k]);
			if (K < lowest) {
				lowest = K;
				at = angles[k];
			}
		}
		add(ratios, (struct ratio){.param = {bT_m, BT_m, cases[i].delay, at},
					   .simulated = lowest,
					   .theory = incise_stability_colgate(
							     &dev, BT_m * UNIT_N_s_mm) /
						     UNIT_N_mm,
					   .at_least = cases[i].at_least});
	}
}

/* --- energy that an encoder makes, and friction that takes it --- */

/* The stiffness at which a hand that goes to and fro by @way in each tick, about @centre,
 * gets as much energy as friction takes. */
static double shaken(const struct incise_haptic_device *d, double way, double centre)
{
	const int ticks = 1000;
	double made = 0, taken = 0;

	for (int k = 0; k < ticks; k++) {
		double side = k % 2 ? 0.5 : -0.5, x = centre + side * way;
		double next = centre - side * way;
		/* For a stiffness of 1: all is proportional to it. */
		double force = -floor(x / d->encoder_mm) * d->encoder_mm;

		made += force * (next - x);
		taken += d->coulomb_N * fabs(next - x) +
			 d->damping_N_s_mm * (next - x) * (next - x) / d->period_s;
	}
	return made > 0 ? taken / made : INFINITY;
}

static void quantisation(struct ratios *ratios, bool quick)
{
	/* Coulomb friction decides, then viscous friction, then both alike. */
	static const struct {
		double b_N_s_mm, c_N, encoder_mm;
	} cases[] = {{0.05, 0.05, 0.01},
		     {0.005, 0.2, 0.01},
		     {0.01, 0.1, 0.01},
		     {0.05, 0.01, 0.03},
		     {0.001, 0.1, 0.001}};
	const int centres = quick ? 9 : 33;

	for (int i = 0; i < N(cases); i++) {
		struct incise_haptic_device d = {.mass_kg = DEVICE_KG,
						 .damping_N_s_mm = cases[i].b_N_s_mm,
						 .coulomb_N = cases[i].c_N,
						 .encoder_mm = cases[i].encoder_mm,
						 .period_s = PERIOD_S};
		double lowest = INFINITY, at = 0;

		cli_progress("quantisation: %d", i + 1);
		for (double steps = 1e-6; steps < 1e5; steps *= 1.2)
			for (int c = 0; c < centres; c++) {
				double way = steps * d.encoder_mm;
				double K =
					shaken(&d, way, c * d.encoder_mm / (centres - 1));

				if (K < lowest) {
					lowest = K;
					at = way;
				}
			}
		add(ratios, (struct ratio){.param = {cases[i].b_N_s_mm, cases[i].c_N,
						     cases[i].encoder_mm, at},
					   .simulated = lowest,
					   .theory = incise_stability_quantisation(&d)});
	}
}

/* --- experiments --- */

#define TOLERANCE 0.01 /* of the ratio, about 1 */

/* A simulation next to theory. */
static const struct experiment {
	void (*measure)(struct ratios *ratios, bool quick);
	const char *key, *params[PARAMS], *simulated, *theory;
} experiments[] = {
	{exact_limit,
	 "exact_limit",
	 {"bT_m", "BT_m", "delay"},
	 "sim_KT2_m",
	 "theory_KT2_m"},
	{colgate,
	 "colgate",
	 {"bT_m", "BT_m", "delay", "angle"},
	 "sim_KT2_m",
	 "theory_KT2_m"},
	{quantisation,
	 "quantisation",
	 {"b_N_s_mm", "coulomb_N", "encoder_mm", "worst_way_mm"},
	 "sim_N_mm",
	 "theory_N_mm"},
};

static struct ratios results[N(experiments)];

static void add(struct ratios *ratios, struct ratio row)
{
	if (ratios->n == RATIOS_MAX)
		cli_fail("%s: more than %d rows", ratios->experiment->key, RATIOS_MAX);
	row.ratio = row.simulated == row.theory ? 1 : row.simulated / row.theory;
	row.ok = row.ratio >= 1 - TOLERANCE &&
		 (row.at_least || row.ratio <= 1 + TOLERANCE);
	ratios->row[ratios->n++] = row;
	cli_progress("%s: %d", ratios->experiment->key, ratios->n);
}

static void make_table(struct ratios *ratios)
{
	const struct experiment *e = ratios->experiment;
	const struct bench_column rest[] = {
		COLUMN(ratio, e->simulated, simulated),
		COLUMN(ratio, e->theory, theory),
		COLUMN(ratio, "ratio", ratio),
		COLUMN(ratio, "at_least", at_least),
		COLUMN(ratio, "ok", ok),
	};
	struct bench_column *c = ratios->table.columns;

	ratios->table.key = e->key;
	ratios->table.row_bytes = sizeof(struct ratio);
	for (int p = 0; p < PARAMS && e->params[p]; p++) {
		*c = (struct bench_column)COLUMN(ratio, e->params[p], param[0],
						 .whole = true);
		c++->offset += (size_t)p * sizeof(double);
	}
	memcpy(c, rest, sizeof(rest));
}

/* A bench that finds theory and simulation apart has found a fault in one of them. */
static void judge_ratios(struct bench_run *run, const struct ratios *ratios)
{
	const struct experiment *e = ratios->experiment;
	char params[200] = "";
	int missed = 0, n = 0;

	for (int i = 0; i < ratios->n; i++) {
		const struct ratio *row = &ratios->row[i];

		if (row->ok || missed++)
			continue;
		for (int p = 0; p < PARAMS && e->params[p]; p++)
			n += snprintf(params + n, sizeof(params) - (size_t)n, "%s%s %g",
				      p ? ", " : "", e->params[p], row->param[p]);
		snprintf(params + n, sizeof(params) - (size_t)n, ": %.3f of theory",
			 row->ratio);
	}
	if (missed)
		bench_fail(run,
			   "%s: %d of %d differ from theory by more than %g %%, first "
			   "%s: please report it",
			   e->key, missed, ratios->n, 100 * TOLERANCE, params);
}

/* The deviation of the worst ratio, and the number of tries. */
static void add_metrics(json_t *metrics, const struct ratios *ratios)
{
	const char *key = ratios->table.key;
	double worst = 0, n = ratios->n;

	for (const struct ratio *r = ratios->row; r < ratios->row + ratios->n; r++)
		/* Where theory is a lower bound more is not wrong. */
		worst = fmax(worst, r->at_least ? 1 - r->ratio : fabs(r->ratio - 1));
	metrics_add(metrics, METRIC_EXACT, &worst, "1", "%s worst ratio off", key);
	metrics_more_is_better(
		metrics_add(metrics, METRIC_EXACT, &n, "1", "%s tried", key));
}

static void report_ratios(struct bench_run *run)
{
	for (int i = 0; i < N(experiments); i++) {
		struct ratios *r = &results[i];

		make_table(r);
		bench_rows(run, &r->table, r->row, r->n);
		add_metrics(run->metrics, r);
		judge_ratios(run, r);
	}
}

/* Curves of theory for the map, for unit mass and period. */
static void add_curves(struct bench_run *run)
{
	static struct bench_point points[6000];
	const struct ratios *exact = &results[0];
	int n = 0;

	for (const struct ratio *r = exact->row; r < exact->row + exact->n; r++) {
		struct incise_haptic_device device = {
			.mass_kg = 1000, .period_s = 1, .delay_ticks = (int)r->param[2]};

		/* Rows of a wall and a delay stand together. */
		if (r > exact->row && r->param[1] == r[-1].param[1] &&
		    r->param[2] == r[-1].param[2])
			continue;
		for (double b = 5e-4; b < 20 && n < N(points); b *= 1.03) {
			double K;

			device.damping_N_s_mm = b;
			K = incise_stability_limit(&device, r->param[1]);
			points[n] = (struct bench_point){.x = b, .y = K > 0 ? K : NAN};
			snprintf(points[n].block, sizeof(points[n].block), "%g %g",
				 r->param[1], r->param[2]);
			n++;
		}
	}
	bench_rows(run, &bench_points, points, n);
}

/* --- the bench --- */

static void run_stability(struct bench_run *run)
{
	struct incise_error err = {0};

	/* A model that cannot be read is said before any work. */
	if (run->n_operands)
		incise_model_free(
			cli_require(incise_model_load(run->operands[0], &err), &err));
	for (int i = 0; i < N(experiments); i++) {
		results[i].experiment = &experiments[i];
		experiments[i].measure(&results[i], run->quick);
	}
	cli_progress_end();
	report_ratios(run);
	add_curves(run);
	stability_rest(run);
	stability_integrators(run);
}

const struct bench bench_stability = {
	.name = "stability",
	.operands = "[MODEL.fis]",
	.n_operands = 1,
	.summary = "stability limits, simulated and computed; scenes at rest; "
		   "integrators",
	.run = run_stability,
	.plot = {.suffix = "map",
		 .script = text_stability_map_gp,
		 .width = 340,
		 .height = 540,
		 .across = "BT_m",
		 .data = &results[0].table,
		 .more = &bench_points},
};
