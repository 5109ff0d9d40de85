// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Duals of the directions of a rig's actuators; see axes.h.
 */
#include "../base/vector.h"
#include "axes.h"

/* The part of @a at right angles to the other directions; along it lies the dual of @a. */
static void apart(double to[3], int n, const double direction[][3], int i)
{
	const double *a = direction[i];
	double across[3];

	v3_copy(to, a);
	if (n == 2)
		v3_add(to, a, -v3_dot(a, direction[1 - i]), direction[1 - i]);
	if (n != 3)
		return;
	v3_cross(across, direction[(i + 1) % 3], direction[(i + 2) % 3]);
	for (int k = 0; k < 3; k++)
		to[k] = v3_dot(a, across) * across[k];
}

void incise_axes_dual(int n, const double direction[][3], double dual[][3])
{
	double out[3];

	for (int i = 0; i < n; i++) {
		apart(out, n, direction, i);
		/* A single direction stays as it is, to the bit. */
		for (int k = 0; k < 3; k++)
			dual[i][k] = n > 1 ? out[k] / v3_dot(out, direction[i]) : out[k];
	}
}
