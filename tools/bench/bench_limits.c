// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Limits of a sampled wall, simulated and computed; see bench_limits.h.
 */
#include <math.h>
#include <stddef.h>
#include "../../lib/control/stability.h"
#include "bench_device.h"
#include "bench_limits.h"
#include "../cli/cli.h"
#include "sampled_wall.h"

#define N(array) (sizeof(array) / sizeof(*(array)))

#define UNIT_N_s_mm (DEVICE / PERIOD_S)	   /* m/T */
#define UNIT_N_mm (UNIT_N_s_mm / PERIOD_S) /* m/T² */

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
				     .period_s = PERIOD_S,
				     .delay = delay};
}

void bench_exact_limit(struct ratios *ratios, bool quick)
{
	static const double dampings[] = {0.001, 0.01, 0.1, 1, 3, 10};
	static const double walls[] = {0, 0.1, 0.3};
	static const int delays[] = {0, 1, 2, 5};

	/* Quick: every other damping and delay, two walls. */
	for (size_t d = 0; d < N(delays); d += quick ? 2 : 1)
		for (size_t w = 0; w < (quick ? 2 : N(walls)); w++)
			for (size_t b = quick ? 1 : 0; b < N(dampings);
			     b += quick ? 2 : 1) {
				struct incise_haptic_device dev =
					device(dampings[b], delays[d]);
				struct sampled_wall sim =
					wall(dampings[b], walls[w], delays[d]);
				struct ratio row = {
					{dampings[b], walls[w], delays[d]},
					sampled_wall_limit(&sim) / UNIT_N_mm,
					incise_stability_limit(&dev,
							       walls[w] * UNIT_N_s_mm) /
						UNIT_N_mm,
					false};

				ratios_add(ratios, row);
				cli_progress("exact limit: %d", ratios->n);
			}
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
	return sampled_wall_limit(&sim);
}

void bench_colgate(struct ratios *ratios, bool quick)
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

	for (size_t i = 0; i < (quick ? 4 : N(cases)); i++) {
		struct incise_haptic_device dev = device(bT_m, cases[i].delay);
		struct sampled_wall sim = wall(bT_m, cases[i].BT_m, cases[i].delay);
		double lowest = INFINITY, at = 0;

		for (size_t k = 0; k < (quick ? 3 : N(angles)); k++) {
			double K = limit_in_hand(sim, angles[k]) / UNIT_N_mm;

			cli_progress("in a hand: %zu, angle %g", i + 1, angles[k]);
			if (K < lowest) {
				lowest = K;
				at = angles[k];
			}
		}
		ratios_add(ratios,
			   (struct ratio){{bT_m, cases[i].BT_m, cases[i].delay, at},
					  lowest,
					  incise_stability_colgate(
						  &dev, cases[i].BT_m * UNIT_N_s_mm) /
						  UNIT_N_mm,
					  cases[i].at_least});
	}
}

void bench_gil(struct ratios *ratios, bool quick)
{
	static const double dampings[] = {0.002, 0.01};
	static const double walls[] = {0, 0.005, -0.001};
	static const int delays[] = {0, 1, 5};

	for (size_t d = 0; d < (quick ? 2 : N(delays)); d++)
		for (size_t w = 0; w < (quick ? 2 : N(walls)); w++)
			for (size_t b = quick ? 1 : 0; b < N(dampings); b++) {
				struct incise_haptic_device dev =
					device(dampings[b], delays[d]);
				struct sampled_wall sim =
					wall(dampings[b], walls[w], delays[d]);

				ratios_add(ratios,
					   (struct ratio){
						   {dampings[b], walls[w], delays[d]},
						   sampled_wall_limit(&sim) / UNIT_N_mm,
						   incise_stability_gil(
							   &dev, walls[w] * UNIT_N_s_mm) /
							   UNIT_N_mm,
						   false});
				cli_progress("linear law: %d", ratios->n);
			}
}
