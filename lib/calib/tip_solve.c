// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The least squares of a pivot calibration. Lengths in mm.
 *
 * With c eliminated the six unknowns are three: n(I - R̄ᵀR̄) t = -Σ (R_i - R̄)ᵀ(p_i - p̄). The
 * eigenvalues of the matrix say what the motion fixes: of a direction that all poses leave
 * where it is, nothing, and its eigenvalue is 0.
 *
 * A part of one noun: tests/unit/calib/tip.c tests it through its door.
 */
#include <math.h>
#include <string.h>
#include <lapacke.h>
#include "../base/vector.h"
#include "tip.h"

#define EIGENVALUE_MIN 1e-9 /* noise of 0.025 degrees makes 2e-7 of none */

void tip_turn(double to[3], const double r[9], const double v[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = v3_dot(r + 3 * i, v);
}

static void turn_back(double to[3], const double r[9], const double v[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2];
}

bool tip_solve(const struct tip_poses *poses, const int *list, int n,
	       struct tip_solution *s)
{
	double mean_p[3] = {0}, right[3] = {0}, step[3];

	memset(s, 0, sizeof(*s));
	s->n = n;
	if (n < 2)
		return false;
	for (int i = 0; i < n; i++) {
		int at = list ? list[i] : i;

		for (int k = 0; k < 3; k++)
			mean_p[k] += poses->p[at][k] / n;
		for (int k = 0; k < 9; k++)
			s->mean_r[k] += poses->r[at][k] / n;
	}
	for (int i = 0; i < n; i++) {
		int at = list ? list[i] : i;
		double d[9], dp[3], part[3];

		for (int k = 0; k < 9; k++)
			d[k] = poses->r[at][k] - s->mean_r[k];
		v3_sub(dp, poses->p[at], mean_p);
		turn_back(part, d, dp);
		v3_add(right, right, -1.0 / n, part);
		/* not I - R̄ᵀR̄, which would cancel where they turn little */
		for (int a = 0; a < 3; a++)
			for (int b = 0; b <= a; b++)
				s->vectors[3 * a + b] +=
					(d[a] * d[b] + d[3 + a] * d[3 + b] +
					 d[6 + a] * d[6 + b]) /
					n;
	}
	if (LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'V', 'L', 3, s->vectors, 3, s->values) ||
	    !(s->values[0] > EIGENVALUE_MIN))
		return false;
	turn_back(step, s->vectors, right);
	for (int k = 0; k < 3; k++)
		step[k] /= s->values[k];
	tip_turn(s->t, s->vectors, step);
	tip_turn(s->c, s->mean_r, s->t);
	v3_add(s->c, s->c, 1, mean_p);
	return v3_finite(s->t) && v3_finite(s->c);
}

void tip_residuals(struct tip_poses *poses, const struct tip_solution *s)
{
	for (int i = 0; i < poses->n; i++) {
		double *r = poses->residual[i];

		tip_turn(r, poses->r[i], s->t);
		v3_add(r, r, 1, poses->p[i]);
		v3_sub(r, r, s->c);
		poses->square[i] = v3_dot(r, r);
	}
}
