// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Cutting force of the virtual liver; see world.h. F = front(mean(depth, speed)) · tooth · bound.
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
 * Front: mean is the force of a blade that cuts. When it draws back, the tissue unloads with the
 * stiffness unloading_N_mm, and then there is friction, up to the front; see ../tissue/front.proto.c.
 * Each cut of the script is a new one; a cut made by hand stays open where it is. Teeth tear
 * only while the blade cuts. Closed motions take work; with teeth, which are no part of the front's
 * account, all but one in some hundreds of wild ones do.
 *
 * A press does not cut: there is no front. The tissue springs back, and a force that grows with
 * speed acts against the motion.
 *
 * With withdrawal = paper all of that is mean, in both directions.
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

/* Mean speed of the surgeon's presses at the surface. */
#define PRESSED_MM_S 70.0

/*
 * Tissue that is only pressed springs back. The law's share of speed acts against the motion, and
 * in proportion to it, as in foam: friction of any other kind would look like a delay.
 */
static double pressing_force(const struct incise_sim_config *config,
			     const struct incise_blade *blade)
{
	double into_mm_s = -blade->velocity_mm_s[2];
	double share =
		1 + config->viscous * into_mm_s / (PRESSED_MM_S + config->viscous_mm_s);

	return incise_sim_mean_force(config, blade->depth_mm, 0) * fmax(share, 0);
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

/* Tooth and bound; only cutting has teeth. */
static double factor(const struct incise_tissue *tissue, const struct incise_blade *blade,
		     double path_mm)
{
	bool cuts = tissue->config->motion == INCISE_SURGEON_CUTS;

	return (cuts ? tooth_factor(tissue, path_mm) : 1) * bound_factor(tissue, blade);
}

/* Move the front on to the blade; whether that cuts. The force without tooth and bound. */
static INCISE_REALTIME double front_force(struct incise_tissue *tissue,
					  const struct incise_blade *blade, bool *cuts)
{
	const double up[3] = {0, 0, 1};
	const struct incise_sim_config *config = tissue->config;
	const double at_mm[3] = {blade->position_mm[0], blade->position_mm[1], 0};
	double mean_N = incise_sim_mean_force(config, blade->depth_mm, blade->speed_mm_s);
	double force_N, advance_mm;

	if (!tissue->inside) {
		if (blade->cut != tissue->cut)
			tissue->front = (struct incise_double_front){0};
		if (incise_double_front_enter(&tissue->front, at_mm, up, blade->side)) {
			tissue->work_N_mm = tissue->most_N_mm = 0;
			tissue->factor = factor(tissue, blade, tissue->path_mm);
		}
		tissue->force_N = 0;
		tissue->inside = true;
		tissue->cut = blade->cut;
	}
	advance_mm = incise_double_front_advance(&tissue->front, at_mm, up, blade->side);
	force_N = incise_double_front_force(&tissue->front, config->unloading_N_mm,
					    config->friction, blade->depth_mm, advance_mm,
					    mean_N);
	*cuts = force_N >= mean_N;
	return force_N;
}

/*
 * The force on a blade that has moved on for @ahead_s since the last advance; whether it cuts.
 * The tissue comes with it.
 */
static INCISE_REALTIME double force_at(struct incise_tissue *tissue,
				       const struct incise_blade *blade, double ahead_s,
				       bool *cuts)
{
	const struct incise_sim_config *config = tissue->config;
	double path_mm = tissue->path_mm + blade->speed_mm_s * ahead_s;
	double from_mm, half_way_mm, front_N, force_N, work_N_mm;

	*cuts = true;
	if (config->withdrawal == INCISE_TISSUE_PAPER)
		return incise_sim_mean_force(config, blade->depth_mm, blade->speed_mm_s) *
		       factor(tissue, blade, path_mm);
	if (config->motion == INCISE_SURGEON_PRESSES)
		return pressing_force(config, blade) * bound_factor(tissue, blade);
	from_mm = tissue->inside ? tissue->front.depth : 0;
	front_N = front_force(tissue, blade, cuts);
	half_way_mm = (blade->depth_mm - from_mm) / 2;
	if (*cuts)
		tissue->factor = factor(tissue, blade, path_mm);
	force_N = front_N * tissue->factor;
	/*
	 * The front's account has no tooth and bound: once all is given back, only an elastic
	 * force is left.
	 */
	work_N_mm = tissue->work_N_mm + (tissue->force_N + force_N) * half_way_mm;
	if (work_N_mm < INCISE_FRONT_KEPT * tissue->most_N_mm) {
		double most_N = half_way_mm > 0
					? fmax(tissue->force_N, 0) +
						  2 * half_way_mm * config->unloading_N_mm
					: 0;

		force_N = fmin(force_N, most_N);
		work_N_mm = tissue->work_N_mm + (tissue->force_N + force_N) * half_way_mm;
	}
	tissue->work_N_mm = work_N_mm;
	tissue->most_N_mm = fmax(tissue->most_N_mm, tissue->work_N_mm);
	tissue->force_N = force_N;
	return force_N;
}

void incise_tissue_advance(struct incise_tissue *tissue, const struct incise_blade *blade,
			   double dt_s)
{
	bool cuts;

	if (blade->depth_mm <= 0) {
		tissue->inside = false;
		return;
	}
	force_at(tissue, blade, 0, &cuts);
	if (!cuts || tissue->config->motion != INCISE_SURGEON_CUTS)
		return;
	tissue->path_mm += blade->speed_mm_s * dt_s;
	while (tissue->path_mm >= tissue->fracture_mm + tissue->tooth_mm)
		next_tooth(tissue);
}

double incise_tissue_force(const struct incise_tissue *tissue,
			   const struct incise_blade *blade, double ahead_s)
{
	struct incise_tissue now = *tissue;
	bool cuts;

	return blade->depth_mm > 0 ? force_at(&now, blade, ahead_s, &cuts) : 0;
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
