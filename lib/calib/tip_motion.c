// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What the motion of a pivot calibration was: how far directions of the sensor swept.
 *
 * A part of one noun: tests/unit/calib/tip.c tests it through its door.
 */
#include <math.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "tip.h"

#define DIRECTIONS_MAX 1500 /* compared each with each */

/* Shortest tip that tells where the tool points; a shorter one is a correction. */
#define TOOL_MIN_MM 10.0

/* Largest angle between two directions that an axis of the sensor took. */
static double swept_deg(const struct tip_poses *poses, int n, const double axis[3])
{
	int stride = 1 + n / DIRECTIONS_MAX, m = 0;
	double least = 1;
	double(*to)[3] = malloc((size_t)(n / stride + 1) * sizeof(*to));

	if (!to)
		return 0;
	for (int i = 0; i < n; i += stride)
		tip_turn(to[m++], poses->r[poses->list[i]], axis);
	for (int i = 0; i < m; i++)
		for (int j = 0; j < i; j++)
			least = fmin(least, v3_dot(to[i], to[j]));
	free(to);
	return acos(fmax(-1, least)) * 180 / M_PI;
}

void tip_motion(const struct tip_poses *poses, int n, const struct tip_solution *s,
		struct incise_tip_fit *fit)
{
	double largest = sqrt(fmax(0, 1 - s->values[0])), tool[3];

	for (int k = 0; k < 3; k++)
		fit->least[k] = s->vectors[3 * k];
	fit->least_deg = swept_deg(poses, n, fit->least);
	fit->cone_deg = fit->least_deg;
	if (v3_unit(tool, s->t, TOOL_MIN_MM))
		fit->cone_deg = swept_deg(poses, n, tool);
	/* singular values of [R -I] are √(n(1 ± s)), s those of R̄ */
	fit->condition = sqrt((1 + largest) / fmax(s->values[0] / (1 + largest), 1e-300));
}
