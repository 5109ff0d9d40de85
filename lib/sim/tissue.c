// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Cutting force of the virtual liver; see world.h. F = mean(depth, speed) · tooth · bound.
 *
 * Tooth: the tissue stretches along the cut until it tears, repeatedly. Its mean over the path
 * is 1, so that the mean force follows the stated law:
 *
 *   1 + a      /|    /|      /|
 *   1         / |   / |     / |        teeth of random length, mean tooth_mm
 *   1 - a    /  |  /  |    /  |
 *          --------------------------▶ path
 *
 * Bound: the slab's support. A random factor for each cut, and a total drift of `boundary` along
 * the slab, from the fixed, stiff end to the free one.
 *
 * Withdrawal follows the same law: the edge still lies in the cut and meets its walls.
 */
#include <math.h>
#include "../base/random.h"
#include "world.h"

static void next_tooth(struct incise_tissue *tissue)
{
	double spread = 0.5 + incise_random_uniform(tissue->tooth_key, tissue->teeth++);

	tissue->fracture_mm += tissue->tooth_mm;
	tissue->tooth_mm = tissue->config->tooth_mm * spread;
}

void incise_tissue_init(struct incise_tissue *tissue,
			const struct incise_sim_config *config)
{
	*tissue = (struct incise_tissue){
		.config = config,
		.tooth_key = incise_random_key(config->seed, INCISE_RANDOM_TOOTH),
		.boundary_key = incise_random_key(config->seed, INCISE_RANDOM_BOUNDARY),
	};
	next_tooth(tissue);
}

void incise_tissue_advance(struct incise_tissue *tissue, const struct incise_blade *blade,
			   double dt_s)
{
	/* only cutting has teeth */
	if (blade->depth_mm <= 0 || tissue->config->motion != INCISE_SURGEON_CUTS)
		return;
	tissue->path_mm += blade->speed_mm_s * dt_s;
	while (tissue->path_mm >= tissue->fracture_mm + tissue->tooth_mm)
		next_tooth(tissue);
}

static double tooth_factor(const struct incise_tissue *tissue, double path_mm)
{
	double share = (path_mm - tissue->fracture_mm) / tissue->tooth_mm;

	return 1 + tissue->config->tooth * (2 * fmin(share, 1) - 1);
}

static double bound_factor(const struct incise_tissue *tissue,
			   const struct incise_blade *blade)
{
	double size = tissue->config->boundary;
	double deviate = incise_random_normal(tissue->boundary_key, blade->boundary);

	/* 2.5 sd clips one cut in 80; at the largest size the factor stays positive. */
	deviate = fmax(-2.5, fmin(2.5, deviate));
	return (1 + size * deviate) * (1 + size * (0.5 - blade->slab));
}

double incise_tissue_force(const struct incise_tissue *tissue,
			   const struct incise_blade *blade, double ahead_s)
{
	bool cuts = tissue->config->motion == INCISE_SURGEON_CUTS;
	double path_mm = tissue->path_mm + blade->speed_mm_s * ahead_s;

	if (blade->depth_mm <= 0)
		return 0;
	return incise_sim_mean_force(tissue->config, blade->depth_mm, blade->speed_mm_s) *
	       (cuts ? tooth_factor(tissue, path_mm) : 1) * bound_factor(tissue, blade);
}

double incise_sim_mean_force(const struct incise_sim_config *config, double depth_mm,
			     double velocity_mm_s)
{
	double speed = fabs(velocity_mm_s);
	double elastic = config->elastic1_N_mm + config->elastic2_N_mm2 * depth_mm;

	if (!(depth_mm > 0))
		return 0;
	return elastic * depth_mm *
	       (1 + config->viscous * speed / (speed + config->viscous_mm_s));
}
