// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The forces of paper 2; see effects.h.
 */
#include "../base/vector.h"
#include "effects.h"

void incise_effect_reaction(double force[3], double size_N, const double n[3])
{
	v3_add(force, force, size_N, n);
}

void incise_effect_plane(double force[3], double k_N_mm, const double p[3],
			 const double p0[3], const double side[3])
{
	double off[3];

	v3_sub(off, p, p0);
	v3_add(force, force, -k_N_mm * v3_dot(off, side), side);
}

void incise_effect_damping(double force[3], double k_N_s_mm, const double v[3])
{
	v3_add(force, force, -k_N_s_mm, v);
}

double incise_orientation_factor(const double flat[3], const double along[3],
				 double aligned)
{
	double across = fmin(fabs(v3_dot(flat, along)), 1);

	return aligned + (1 - aligned) * across;
}

void incise_effect_spread(double force[3], double k_N_mm, const double p[3],
			  const double p0[3], const double n[3])
{
	double off[3];

	v3_sub(off, p, p0);
	v3_add(off, off, -v3_dot(off, n), n);
	v3_add(force, force, -k_N_mm, off);
}
