/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A sampled wall on a plant, in time: whether a motion grows, and from which stiffness on.
 * Nothing here knows of an eigenvalue.
 *
 *   x_k ──▶ -K x_k - B (x_k - x_{k-1})/T ──▶ delay ticks ──▶ held for T ──▶ plant
 */
#ifndef INCISE_SAMPLED_WALL_H
#define INCISE_SAMPLED_WALL_H

#include "../../lib/control/plant.h"

struct sampled_wall {
	/* Device and whatever it is tied to; no Coulomb friction. */
	struct incise_plant plant;
	double damping_N_s_mm; /* of the wall, B */
	double period_s;
	int delay;
};

/*
 * The stiffness from which on it grows, found by climbing from a very soft wall and then
 * halving to 1e-4; 0 when that already grows.
 */
double sampled_wall_limit(const struct sampled_wall *wall);

#endif
