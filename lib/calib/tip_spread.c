// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The spread of a pivot calibration: its covariance, of noise that may last from pose to
 * pose, and whether the pivot moved.
 *
 * A part of one noun: tests/unit/calib/tip.c tests it through its door.
 */
#include <math.h>
#include <string.h>
#include <lapacke.h>
#include "../base/vector.h"
#include "tip.h"

#define ROUNDING_MM 1e-9
#define BLOCK_TIMES 4

/* Autocorrelation time of the residuals, in poses; 1 where each stands for itself. */
static double time_of(const struct tip_poses *poses, int n)
{
	double zero = 0, time = 1, noise = 3 / sqrt(3.0 * n);

	for (int i = 0; i < n; i++)
		zero += poses->square[poses->list[i]];
	if (zero < n * ROUNDING_MM * ROUNDING_MM)
		return 1;
	for (int lag = 1; lag <= n / 10; lag++) {
		double sum = 0;

		for (int i = lag; i < n; i++)
			sum += v3_dot(poses->residual[poses->list[i]],
				      poses->residual[poses->list[i - lag]]);
		if (sum / zero < noise)
			break;
		time += 2 * sum / zero;
	}
	return time;
}

int tip_block(const struct tip_poses *poses, int n)
{
	double time = time_of(poses, n);

	return time > 1 ? (int)ceil(BLOCK_TIMES * time) : 1;
}

/*
 * What a variance from sums over blocks is too small by: borders between blocks cut off half
 * a time each (Flegal and Jones, Ann. Stat. 38, 2010), six unknowns are two poses' worth of
 * equations, and few blocks have Student's tails, which k = 2 is to hold too.
 */
static double correction(int block, int blocks)
{
	double freedom = fmax(1, blocks - 2), student = 1 + 1.21 / freedom;
	double border = block > 1 ? 1 / (1 - 0.5 / BLOCK_TIMES) : 1;

	return blocks / freedom * border * student * student;
}

/*
 * Sandwich of the fit with a pivot that moves evenly: unknowns t and the pivot's move per
 * half of the run, w. Or without: w 0.
 */
struct sandwich {
	int m; /* unknowns, 3 or 6 */
	double left[36], middle[36], right[6];
};

static void score_rows(double rows[3][6], const struct tip_poses *poses, int at,
		       const struct tip_solution *s, double u)
{
	for (int e = 0; e < 3; e++)
		for (int k = 0; k < 3; k++) {
			rows[e][k] = poses->r[at][3 * e + k] - s->mean_r[3 * e + k];
			rows[e][3 + k] = e == k ? -u : 0;
		}
}

/* x = left⁻¹ right, and its covariance into middle. False: singular. */
static bool sandwich(struct tip_poses *poses, int n, const double *u,
		     const struct tip_solution *s, int block, struct sandwich *w)
{
	int m = w->m, blocks = n / block;
	double sum[6] = {0}, x[6];

	memset(w->left, 0, sizeof(w->left));
	memset(w->right, 0, sizeof(w->right));
	memset(w->middle, 0, sizeof(w->middle));
	for (int i = 0; i < n; i++) {
		const double *r = poses->residual[poses->list[i]];
		double rows[3][6];

		score_rows(rows, poses, poses->list[i], s, u[i]);
		for (int e = 0; e < 3; e++)
			for (int a = 0; a < m; a++) {
				w->right[a] -= rows[e][a] * r[e];
				for (int b = 0; b < m; b++)
					w->left[a * m + b] += rows[e][a] * rows[e][b];
			}
	}
	if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', m, w->left, m))
		return false;
	memcpy(x, w->right, sizeof(x));
	LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', m, 1, w->left, m, x, 1);
	for (int i = 0; i < n; i++) {
		double r[3], rows[3][6];

		v3_copy(r, poses->residual[poses->list[i]]);
		score_rows(rows, poses, poses->list[i], s, u[i]);
		for (int e = 0; e < 3; e++) {
			for (int a = 0; a < m; a++)
				r[e] += rows[e][a] * x[a];
			for (int a = 0; a < m; a++)
				sum[a] += rows[e][a] * r[e];
		}
		/* what is left over goes with the last block */
		if (i != n - 1 && ((i + 1) % block || (i + 1) / block == blocks))
			continue;
		for (int a = 0; a < m; a++)
			for (int b = 0; b < m; b++)
				w->middle[a * m + b] += sum[a] * sum[b];
		memset(sum, 0, sizeof(sum));
	}
	/* middle = left⁻¹ middle left⁻¹, symmetric in between once it is transposed */
	for (int side = 0; side < 2; side++) {
		LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', m, m, w->left, m, w->middle, m);
		for (int a = 0; a < m; a++)
			for (int b = 0; b < a; b++) {
				double keep = w->middle[a * m + b];

				w->middle[a * m + b] = w->middle[b * m + a];
				w->middle[b * m + a] = keep;
			}
	}
	for (int i = 0; i < m * m; i++)
		w->middle[i] *= correction(block, blocks);
	memcpy(w->right, x, sizeof(x));
	return true;
}

void tip_uncertainty(struct tip_poses *poses, int n, const double *u,
		     const struct tip_solution *s, struct incise_tip_fit *fit,
		     double *chi2)
{
	struct sandwich still = {.m = 3}, moving = {.m = 6};
	double c[9], move[3];

	if (sandwich(poses, n, u, s, fit->block, &still))
		memcpy(fit->covariance, still.middle, sizeof(fit->covariance));
	*chi2 = 0;
	if (!sandwich(poses, n, u, s, fit->block, &moving))
		return;
	for (int a = 0; a < 3; a++)
		for (int b = 0; b < 3; b++)
			c[3 * a + b] = moving.middle[(3 + a) * 6 + 3 + b];
	v3_copy(move, moving.right + 3);
	fit->moved_mm = 2 * v3_length(move);
	fit->moved_sd_mm = 2 * sqrt((c[0] + c[4] + c[8]) / 3);
	if (!LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', 3, 1, c, 3, move, 1))
		*chi2 = v3_dot(move, moving.right + 3);
}
