// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The plant and the limits of stability: any device, any hand.
 */
#include <string.h>
#include "../../lib/base/vector.h"
#include "../../lib/control/plant.h"
#include <incise/stability.h>
#include "extremes.h"
#include "numbers.h"

/* One of so many numbers is special. */
#define SOME 8
#define ALL 1

/* A number of many sizes; one of @odds is special. */
static double positive(uint32_t odds, double low, double high)
{
	return below(odds) ? exp(between(log(low), log(high))) : special();
}

static bool can_be(const struct incise_plant *p, double force_N, double period_s)
{
	const double settings[] = {p->mass_kg,	 p->damping_N_s_mm, p->coulomb_N,
				   p->wall_N_mm, p->wall_N_s_mm,    period_s};

	for (int i = 0; i < 6; i++)
		if (!(settings[i] >= 0 && isfinite(settings[i])))
			return false;
	return p->mass_kg > 0 && isfinite(force_N);
}

static void try_plant(struct extremes_row *row, const struct property *property)
{
	uint32_t odds = (uint32_t)property->kind;
	bool all = odds == ALL;
	struct incise_plant was = {
		.mass_kg = positive(odds, 1e-3, 10),
		.damping_N_s_mm = positive(odds, 1e-9, 1),
		.coulomb_N = positive(odds, 1e-6, 10),
		.wall_N_mm = positive(odds, 1e-3, 1e9),
		.wall_N_s_mm = positive(odds, 1e-9, 1),
		.wall_mm = between(-1, 1),
		.tied = below(2),
		.position_mm = all ? special() : between(-10, 10),
		.velocity_mm_s = all ? special() : between(-1000, 1000),
	};
	double force = below(odds) ? between(-1e6, 1e6) : special();
	double period = below(odds) ? exp(between(-21, 8)) : special();
	struct incise_plant plant = was;
	bool can = can_be(&was, force, period), finite;
	bool sane = fabs(force) <= 1e6 && period < 3600 && was.mass_kg >= 1e-3 &&
		    was.mass_kg < 1e6 && was.wall_N_mm < 1e9 && was.wall_N_s_mm < 1e9 &&
		    was.damping_N_s_mm < 1e9 && was.coulomb_N < 1e9 &&
		    fabs(was.position_mm) <= 10 && fabs(was.velocity_mm_s) <= 1000;

	/* Hours of chatter at a stiff wall are a million events, which take a second. */
	if (can && was.wall_N_mm > 0)
		period = fmin(period, 100 * sqrt(was.mass_kg * 1e-3 / was.wall_N_mm));
	incise_plant_step(&plant, force, period);
	finite = isfinite(plant.position_mm) && isfinite(plant.velocity_mm_s);
	if (!can && isnan(plant.position_mm) && isnan(plant.velocity_mm_s))
		extremes_refused_plainly(row);
	else
		extremes_check(
			row, can && (!sane || finite),
			"to %a mm, %a mm/s: mass %a, damping %a, coulomb %a, wall %a, "
			"%a, at %a, tied %d, from %a, %a, force %a, period %a",
			plant.position_mm, plant.velocity_mm_s, was.mass_kg,
			was.damping_N_s_mm, was.coulomb_N, was.wall_N_mm, was.wall_N_s_mm,
			was.wall_mm, was.tied, was.position_mm, was.velocity_mm_s, force,
			period);
}

static void try_stability(struct extremes_row *row, const struct property *property)
{
	struct incise_haptic_device d = {
		.mass_kg = positive(SOME, 1e-3, 10),
		.damping_N_s_mm = positive(SOME, 1e-6, 1),
		.coulomb_N = positive(SOME, 1e-6, 10),
		.encoder_mm = positive(SOME, 1e-6, 1),
		.period_s = 1 / positive(SOME, 1, 64000),
		.delay_ticks = below(8) ? (int)below(65) : (int)any(),
	};
	double damping = below(3) ? 0 : special();
	double exact = incise_stability_limit(&d, damping);
	double passive = incise_stability_colgate(&d, damping);
	double steps = incise_stability_quantisation(&d);
	/* b T/m within the range of the exact limit, and a device that can be. */
	double x = d.damping_N_s_mm * d.period_s / (d.mass_kg * 1e-3);
	bool exactly = x > 1e-6 && x < 100 && damping == 0 && d.delay_ticks >= 0 &&
		       d.delay_ticks <= INCISE_STABILITY_DELAY_MAX && isfinite(passive);

	extremes_check(row,
		       exact >= 0 && passive >= 0 && steps >= 0 &&
			       (!exactly || passive <= exact * (1 + 1e-6)),
		       "limit %a, passive %a, quantised %a: mass %a, damping %a, "
		       "coulomb %a, encoder %a, period %a, delay %d, wall's damping %a",
		       exact, passive, steps, d.mass_kg, d.damping_N_s_mm, d.coulomb_N,
		       d.encoder_mm, d.period_s, d.delay_ticks, damping);
}

const struct property control_properties[] = {
	{"plant",
	 "a mass with friction at a wall of up to 1e9 N/mm under forces of up to 1e6 N, "
	 "for 1 ns to 1 h, or 16 swings: finite; with settings that cannot be: no number",
	 300000, .each = try_plant, .kind = SOME},
	{"plant_special", "the same with special numbers only", 20000, .each = try_plant,
	 .kind = ALL, .for_tests_only = true},
	{"stability_limit",
	 "the stiffest wall of any device, from 1 Hz to 64 kHz: a number from 0 on; and "
	 "what is passive is stable",
	 2500, .each = try_stability},
	{0},
};
