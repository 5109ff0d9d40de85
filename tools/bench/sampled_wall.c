// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A sampled wall in time; see sampled_wall.h.
 */
#include <math.h>
#include <stdbool.h>
#include "bench_device.h"
#include "sampled_wall.h"

#define DELAY_MAX 64

/* A run: some time for what fades at once, then two windows apart.
 *
 *   0      skip       window              gap              window
 *   ├────────────┼──╱‾‾‾‾‾‾‾╲──┼──────────────────────┼──╱‾‾‾‾‾‾‾╲──┤
 */
struct run {
	int skip, window, gap;
	double omega; /* angular frequency that the wall gives: x² + (v/ω)² is amplitude² */
};

static struct run plan(const struct sampled_wall *wall, double stiffness_N_mm)
{
	double m = wall->plant.mass_kg * N_S2_PER_MM_KG, T = wall->period_s;
	double delta = wall->plant.damping_N_s_mm * T / m;
	struct run run = {.omega = sqrt((stiffness_N_mm + wall->plant.wall_N_mm) / m)};

	/* Some twelve swings, so that where one begins does not matter. */
	run.window = fmax(400, fmin(10000, 12 * 2 * M_PI / (run.omega * T)));
	run.skip = run.window + 20 * wall->delay;
	/* A stiffness that is off by 1e-3 changes the growth by δ/2 × 1e-3 per tick. */
	run.gap = fmax(3000, fmin(20000, 20 / delta));
	return run;
}

/* Whether a push at the wall of this stiffness grows. */
static bool grows(const struct sampled_wall *wall, double stiffness_N_mm)
{
	struct run run = plan(wall, stiffness_N_mm);
	struct incise_plant plant = wall->plant;
	double past[DELAY_MAX + 2], sum[2] = {0}, T = wall->period_s;
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
		incise_plant_step(&plant,
				  -stiffness_N_mm * seen -
					  wall->damping_N_s_mm * (seen - before) / T,
				  T);
	}
	return sum[1] > sum[0];
}

double sampled_wall_limit(const struct sampled_wall *wall)
{
	double T = wall->period_s;
	double unit = wall->plant.mass_kg * N_S2_PER_MM_KG / (T * T);
	double lo = 2e-5 * unit, hi;

	if (grows(wall, lo))
		return 0;
	for (hi = 2 * lo; !grows(wall, hi); hi *= 2) {
		if (hi > 1e6 * unit)
			return INFINITY;
		lo = hi;
	}
	while (hi > lo * (1 + 1e-4)) {
		double mid = sqrt(lo * hi);

		if (grows(wall, mid))
			hi = mid;
		else
			lo = mid;
	}
	return sqrt(lo * hi);
}
