// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Pivot calibration; see incise/calibrate_tip.h. Lengths in mm.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "tip.h"

/* Columns are where the axes go to. */
static void rotation(double r[9], const double q[4])
{
	double length = sqrt(q[0] * q[0] + v3_dot(q + 1, q + 1)), unit[4];

	for (int i = 0; i < 4; i++)
		unit[i] = q[i] / length;
	for (int k = 0; k < 3; k++) {
		double axis[3] = {k == 0, k == 1, k == 2}, to[3];

		v3_rotate(to, unit, axis);
		for (int i = 0; i < 3; i++)
			r[3 * i + k] = to[i];
	}
}

static int take(struct tip_poses *to, const struct incise_tip_pose *from,
		struct incise_error *err)
{
	for (int i = 0; i < to->n; i++) {
		const double *q = from[i].quaternion;
		double length = sqrt(q[0] * q[0] + v3_dot(q + 1, q + 1));

		if (!v3_finite(from[i].position_mm) || !isfinite(length) ||
		    v3_length(from[i].position_mm) > 1e6)
			return incise_error_set(err, EINVAL,
						"pose %d: not a number, or no place of "
						"a tool; remove it",
						i + 1);
		if (fabs(length - 1) > 0.02)
			return incise_error_set(err, EINVAL,
						"pose %d: the quaternion's length is "
						"%.3g, not 1; are columns swapped?",
						i + 1, length);
		v3_copy(to->p[i], from[i].position_mm);
		rotation(to->r[i], q);
	}
	return 0;
}

static void release(struct tip_poses *poses)
{
	free(poses->p);
	free(poses->r);
	free(poses->residual);
	free(poses->square);
	free(poses->in);
	free(poses->list);
	free(poses->sorted);
}

static bool make_room(struct tip_poses *poses, int n)
{
	size_t size = (size_t)n;

	*poses = (struct tip_poses){
		.n = n,
		.p = malloc(size * sizeof(*poses->p)),
		.r = malloc(size * sizeof(*poses->r)),
		.residual = malloc(size * sizeof(*poses->residual)),
		.square = malloc(size * sizeof(*poses->square)),
		.in = calloc(size, sizeof(*poses->in)),
		.list = malloc(size * sizeof(*poses->list)),
		.sorted = malloc(size * sizeof(*poses->sorted)),
	};
	return poses->p && poses->r && poses->residual && poses->square && poses->in &&
	       poses->list && poses->sorted;
}

/* Each half's residuals under the fit of the other; blocks of 1/20 take turns. */
static double held_out(struct tip_poses *poses, int n)
{
	int length = n / 20 > 0 ? n / 20 : 1, m;
	int *half = malloc((size_t)n * sizeof(*half));
	struct tip_solution s;
	double sum = 0;

	if (!half)
		return NAN;
	for (int side = 0; side < 2; side++) {
		m = 0;
		for (int i = 0; i < n; i++)
			if (i / length % 2 == side)
				half[m++] = poses->list[i];
		if (!tip_solve(poses, half, m, &s)) {
			sum = NAN;
			break;
		}
		tip_residuals(poses, &s);
		for (int i = 0; i < n; i++)
			if (i / length % 2 != side)
				sum += poses->square[poses->list[i]];
	}
	free(half);
	return sqrt(sum / n);
}

static int fit_poses(struct tip_poses *poses, const struct incise_tip_pose *given,
		     struct incise_tip_fit *fit, struct incise_error *err)
{
	struct tip_solution s;
	double sum = 0, chi2, *u;
	int n;

	if (!tip_robust(poses, &s))
		return incise_error_set(
			err, EDOM,
			"the tool did not turn, or about one axis only; turn it all "
			"ways, the tip in its dimple");
	n = fit->inliers = tip_listed(poses);
	v3_copy(fit->tip_mm, s.t);
	v3_copy(fit->pivot_mm, s.c);
	for (int i = 0; i < n; i++) {
		sum += poses->square[poses->list[i]];
		fit->largest_mm =
			fmax(fit->largest_mm, sqrt(poses->square[poses->list[i]]));
	}
	fit->rms_mm = sqrt(sum / n);
	tip_motion(poses, n, &s, fit);
	fit->block = tip_block(poses, n);
	fit->blocks = n / fit->block;
	u = malloc((size_t)n * sizeof(*u));
	if (!u)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int i = 0; i < n; i++) {
		/* apart, as their difference may not fit its type */
		double first = (double)given[0].t_ns;
		double span = (double)given[poses->n - 1].t_ns - first;

		u[i] = span > 0
			       ? 2 * ((double)given[poses->list[i]].t_ns - first) / span -
					 1
			       : 2.0 * i / n - 1;
	}
	sum = 0;
	for (int i = 0; i < n; i++)
		sum += u[i] / n;
	for (int i = 0; i < n; i++)
		u[i] -= sum;
	tip_uncertainty(poses, n, u, &s, fit, &chi2);
	free(u);
	fit->held_out_mm = held_out(poses, n);
	return tip_judge(poses, fit, chi2, err);
}

int incise_calibrate_tip(const struct incise_tip_pose *poses, int n, bool *inlier,
			 struct incise_tip_fit *fit, struct incise_error *err)
{
	struct tip_poses own;
	int rc;

	*fit = (struct incise_tip_fit){.n = n};
	if (inlier)
		memset(inlier, 0, (size_t)(n > 0 ? n : 0) * sizeof(*inlier));
	if (n < INCISE_TIP_POSES_MIN)
		return incise_error_set(err, EDOM,
					"%d poses are too few, %d are needed at least; "
					"turn the tool longer",
					n, INCISE_TIP_POSES_MIN);
	rc = make_room(&own, n) ? take(&own, poses, err)
				: incise_error_set(err, ENOMEM, "out of memory");
	if (!rc)
		rc = fit_poses(&own, poses, fit, err);
	if (inlier && own.in)
		memcpy(inlier, own.in, (size_t)n * sizeof(*inlier));
	release(&own);
	return rc;
}
