// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The guard of passivity, the plant, and what is known of stability: any devices, any hands.
 */
#include <stdio.h>
#include <string.h>
#include "../../lib/control/guard.h"
#include "../../lib/control/plant.h"
#include "../../lib/control/stability.h"
#include "any_pose.h"
#include "extremes.h"

#define GUARDS 4000
#define CALLS 100
#define PLANTS 300000
#define DEVICES 2500

static double any_number(double scale)
{
	switch (below(6)) {
	case 0:
		return special();
	case 1:
		return any_bits();
	default:
		return between(-scale, scale);
	}
}

static bool finite3(const double v[3])
{
	return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

/* One call, judged by what its header promises. */
static void apply(struct extremes_row *row, struct incise_guard *guard, const double x[3],
		  const double v[3])
{
	struct incise_guard was = *guard;
	double force[3], sent[3];
	bool held;

	for (int i = 0; i < 3; i++)
		sent[i] = force[i] = any_number(10);
	incise_guard_apply(guard, x, v, force);
	held = !isnan(guard->energy_N_mm) && guard->energy_N_mm <= guard->reserve_N_mm &&
	       guard->damping_N_s_mm >= 0 && guard->damping_N_s_mm <= guard->cap_N_s_mm;
	if (!finite3(sent) || guard->reserve_N_mm == 0)
		held = held && !memcmp(sent, force, sizeof(sent)); /* left as it is */
	if (extremes_first_wrong(row, held))
		extremes_tell(
			row,
			"at (%a, %a, %a), v (%a, %a, %a), force (%a, %a, %a) to (%a, "
			"%a, %a), energy %a to %a, damping %a of %a, case %ld",
			x[0], x[1], x[2], v[0], v[1], v[2], sent[0], sent[1], sent[2],
			force[0], force[1], force[2], was.energy_N_mm, guard->energy_N_mm,
			guard->damping_N_s_mm, guard->cap_N_s_mm, row->tried);
	incise_guard_sent(guard, below(4) ? force : x);
}

static void try_guard(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "guard",
		"the guard of passivity, any device, any place, velocity and force: its credit "
		"within the reserve, its damping within the cap, and what is no number left "
		"as it is");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, GUARDS); k; k--) {
		struct incise_guard guard;
		double x[3] = {0};

		incise_guard_init(&guard, below(4) ? exp(between(-9, 3)) : any_number(1),
				  below(4) ? exp(between(-12, 0)) : any_number(1),
				  below(4) ? exp(between(-9, 9)) : any_number(10));
		for (int i = 0; i < CALLS; i++) {
			double v[3];

			for (int a = 0; a < 3; a++) {
				x[a] = below(3) ? x[a] + between(-1, 1) : any_number(100);
				v[a] = any_number(1000);
			}
			if (!below(20))
				incise_guard_reset(&guard);
			if (!below(20))
				incise_guard_leap(&guard);
			apply(row, &guard, x, v);
		}
	}
}

static double positive(double low, double high)
{
	return below(8) ? exp(between(log(low), log(high))) : special();
}

static void try_plant(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "plant",
		"a mass with friction at a wall of up to 1e9 N/mm under forces of up to 1e6 N, "
		"for 1 ns to 1 h, or 16 swings: finite; with settings that cannot be: no number");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, PLANTS); k; k--) {
		struct incise_plant was = {.mass_kg = positive(1e-3, 10),
					   .damping_N_s_mm = positive(1e-9, 1),
					   .coulomb_N = positive(1e-6, 10),
					   .wall_N_mm = positive(1e-3, 1e9),
					   .wall_N_s_mm = positive(1e-9, 1),
					   .wall_mm = between(-1, 1),
					   .tied = below(2),
					   .position_mm = between(-10, 10),
					   .velocity_mm_s = between(-1000, 1000)};
		double force = below(8) ? between(-1e6, 1e6) : special();
		double period = below(8) ? exp(between(-21, 8)) : special();
		struct incise_plant plant = was;
		bool can = was.mass_kg > 0 && was.damping_N_s_mm >= 0 &&
			   was.coulomb_N >= 0 && was.wall_N_mm >= 0 &&
			   was.wall_N_s_mm >= 0 && isfinite(force) && period >= 0 &&
			   isfinite(period) && isfinite(was.mass_kg) &&
			   isfinite(was.damping_N_s_mm) && isfinite(was.coulomb_N) &&
			   isfinite(was.wall_N_mm) && isfinite(was.wall_N_s_mm);
		bool sane = can && fabs(force) <= 1e6 && period < 3600 &&
			    was.mass_kg >= 1e-3 && was.mass_kg < 1e6 &&
			    was.wall_N_mm < 1e9 && was.wall_N_s_mm < 1e9 &&
			    was.damping_N_s_mm < 1e9 && was.coulomb_N < 1e9;

		/* Hours of chatter at a stiff wall are a million events, which take a second. */
		if (can && was.wall_N_mm > 0)
			period = fmin(period,
				      100 * sqrt(was.mass_kg * 1e-3 / was.wall_N_mm));
		incise_plant_step(&plant, force, period);
		if (!can && isnan(plant.position_mm) && isnan(plant.velocity_mm_s)) {
			row->tried++;
			row->refused++;
		} else if (extremes_first_wrong(
				   row,
				   can && (!sane || (isfinite(plant.position_mm) &&
						     isfinite(plant.velocity_mm_s))))) {
			extremes_tell(
				row,
				"to %a mm, %a mm/s: mass %a, damping %a, coulomb %a, wall "
				"%a, %a, at %a, tied %d, from %a, %a, force %a, period "
				"%a, case %ld",
				plant.position_mm, plant.velocity_mm_s, was.mass_kg,
				was.damping_N_s_mm, was.coulomb_N, was.wall_N_mm,
				was.wall_N_s_mm, was.wall_mm, was.tied, was.position_mm,
				was.velocity_mm_s, force, period, row->tried);
		}
	}
}

static void try_stability(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "stability_limit",
		"the stiffest wall of any device, from 1 Hz to 64 kHz: a number from 0 on; and "
		"what is passive is stable");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, DEVICES); k; k--) {
		struct incise_haptic_device d = {.mass_kg = positive(1e-3, 10),
						 .damping_N_s_mm = positive(1e-6, 1),
						 .coulomb_N = positive(1e-6, 10),
						 .encoder_mm = positive(1e-6, 1),
						 .period_s = 1 / positive(1, 64000),
						 .delay_ticks = below(8) ? (int)below(65)
									 : (int)any()};
		double damping = below(3) ? 0 : special();
		double exact = incise_stability_limit(&d, damping);
		double passive = incise_stability_colgate(&d, damping);
		double linear = incise_stability_gil(&d, damping);
		double steps = incise_stability_quantisation(&d);
		/* b T/m within what is said to be exact, and a device that can be. */
		double x = d.damping_N_s_mm * d.period_s / (d.mass_kg * 1e-3);
		bool exactly =
			x > 1e-6 && x < 100 && damping == 0 && d.delay_ticks >= 0 &&
			d.delay_ticks <= INCISE_STABILITY_DELAY_MAX && isfinite(passive);

		if (extremes_first_wrong(row, exact >= 0 && passive >= 0 && linear >= 0 &&
						      steps >= 0 &&
						      (!exactly ||
						       passive <= exact * (1 + 1e-6))))
			extremes_tell(
				row,
				"limit %a, passive %a, linear %a, quantised %a: mass %a, "
				"damping %a, coulomb %a, encoder %a, period %a, delay %d, "
				"wall's damping %a, case %ld",
				exact, passive, linear, steps, d.mass_kg,
				d.damping_N_s_mm, d.coulomb_N, d.encoder_mm, d.period_s,
				d.delay_ticks, damping, row->tried);
	}
}

void extremes_guard(struct extremes *all)
{
	try_guard(all);
	try_plant(all);
	try_stability(all);
}
