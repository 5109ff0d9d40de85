// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Pivot calibration; see incise/calibrate_tip.h. Lengths in mm.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_tip.h>
#include "../base/ascending.h"
#include "../base/random.h"
#include "../base/vector.h"
#include "dense.h"

/* A pose as the fit has it. */
struct pose {
	double p[3];	    /* mm */
	double r[9];	    /* rotation, row by row */
	double residual[3]; /* mm, of the last tip_residuals() */
	double square;	    /* its length squared */
	bool in;
};

struct tip_poses {
	int n;
	struct pose *pose;
	int *list;	/* scratch: n indices */
	double *sorted; /* scratch: n */
};

/* A solution, and the means that it rests upon. */
struct tip_solution {
	double t[3], c[3];
	double mean_r[9];
	double values[3], vectors[9]; /* of I - R̄ᵀR̄, ascending; vector k is column k */
	int n;
};

/*
 * --- least squares ---
 *
 * With c eliminated the six unknowns are three: n(I - R̄ᵀR̄) t = -Σ (R_i - R̄)ᵀ(p_i - p̄). The
 * eigenvalues of the matrix say how well the motion fixes each direction: one that all poses leave
 * where it is has eigenvalue 0.
 */

#define EIGENVALUE_MIN 1e-9 /* noise of 0.025 degrees makes 2e-7 of none */

/* to = r·v */
static void tip_turn(double to[3], const double r[9], const double v[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = v3_dot(r + 3 * i, v);
}

static void turn_back(double to[3], const double r[9], const double v[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2];
}

/* Solve for the poses of the list (NULL: the first n). False: they do not fix the tip. */
static bool tip_solve(const struct tip_poses *poses, const int *list, int n,
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
			mean_p[k] += poses->pose[at].p[k] / n;
		for (int k = 0; k < 9; k++)
			s->mean_r[k] += poses->pose[at].r[k] / n;
	}
	for (int i = 0; i < n; i++) {
		int at = list ? list[i] : i;
		double d[9], dp[3], part[3];

		for (int k = 0; k < 9; k++)
			d[k] = poses->pose[at].r[k] - s->mean_r[k];
		v3_sub(dp, poses->pose[at].p, mean_p);
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
	incise_eigen(s->vectors, 3, s->values);
	if (!(s->values[0] > EIGENVALUE_MIN))
		return false;
	turn_back(step, s->vectors, right);
	for (int k = 0; k < 3; k++)
		step[k] /= s->values[k];
	tip_turn(s->t, s->vectors, step);
	tip_turn(s->c, s->mean_r, s->t);
	v3_add(s->c, s->c, 1, mean_p);
	return v3_finite(s->t) && v3_finite(s->c);
}

/* Residuals of all poses under a solution. */
static void tip_residuals(struct tip_poses *poses, const struct tip_solution *s)
{
	for (int i = 0; i < poses->n; i++) {
		double *r = poses->pose[i].residual;

		tip_turn(r, poses->pose[i].r, s->t);
		v3_add(r, r, 1, poses->pose[i].p);
		v3_sub(r, r, s->c);
		poses->pose[i].square = v3_dot(r, r);
	}
}

/*
 * --- inliers ---
 *
 * Poses that are about one pivot: least trimmed squares by concentration steps (Rousseeuw and
 * Van Driessen, Data Min. Knowl. Discov. 12, 2006), then all that are near it.
 */

#define STARTS 60
#define FINALISTS 5
#define START_POSES 4  /* two fix five of the six unknowns, three all: one to spare */
#define SAMPLE_MAX 200 /* poses of the search */
#define SHARE 0.6      /* of them that are fitted */
#define STEPS 10

/*
 * Median of the length of three normal deviates. Where noise is larger across the tool,
 * lengths are those of two: 5 scales are then 3.8 sd, which one good pose in 1500 exceeds.
 */
#define MEDIAN_LENGTH 1.538
#define FAR 5.0

static double quantile(struct tip_poses *sample, int at)
{
	for (int i = 0; i < sample->n; i++)
		sample->sorted[i] = sample->pose[i].square;
	qsort(sample->sorted, (size_t)sample->n, sizeof(double), ascending);
	return sample->sorted[at];
}

/* Fit the nearest h, some times. Returns the sum of their squares; HUGE_VAL: no solution. */
static double concentrate(struct tip_poses *sample, struct tip_solution *s, int h,
			  int steps)
{
	double sum = 0, limit;

	for (int step = 0; step < steps; step++) {
		int n = 0;

		tip_residuals(sample, s);
		limit = quantile(sample, h - 1);
		sum = 0;
		for (int i = 0; i < sample->n; i++)
			if (sample->pose[i].square <= limit) {
				sample->list[n++] = i;
				sum += sample->pose[i].square;
			}
		if (!tip_solve(sample, sample->list, n, s))
			return HUGE_VAL;
	}
	return sum;
}

static void search_calibrate_tip(struct tip_poses *sample, struct tip_solution *best)
{
	struct tip_solution finalists[FINALISTS], s;
	double sums[FINALISTS], sum;
	int h = (int)ceil(SHARE * sample->n);
	uint64_t state = 1; /* the same each time: a fit is to be repeatable */

	for (int i = 0; i < FINALISTS; i++)
		sums[i] = HUGE_VAL;
	for (int start = 0; start < STARTS; start++) {
		int few[START_POSES], at = FINALISTS;

		for (int i = 0; i < START_POSES; i++)
			few[i] = (int)incise_random_draw(&state, (uint32_t)sample->n);
		if (!tip_solve(sample, few, START_POSES, &s))
			continue;
		sum = concentrate(sample, &s, h, 2);
		while (at > 0 && sum < sums[at - 1])
			at--;
		if (at == FINALISTS)
			continue;
		for (int i = FINALISTS - 1; i > at; i--) {
			sums[i] = sums[i - 1];
			finalists[i] = finalists[i - 1];
		}
		sums[at] = sum;
		finalists[at] = s;
	}
	sum = HUGE_VAL;
	for (int i = 0; i < FINALISTS && sums[i] < HUGE_VAL; i++) {
		double reached = concentrate(sample, &finalists[i], h, STEPS);

		if (reached < sum) {
			sum = reached;
			*best = finalists[i];
		}
	}
}

/* List the marked poses in ->list; returns their number. */
static int tip_listed(const struct tip_poses *poses)
{
	int n = 0;

	for (int i = 0; i < poses->n; i++)
		if (poses->pose[i].in)
			poses->list[n++] = i;
	return n;
}

/* Mark the poses that are about one pivot and solve by them. False: none fixes the tip. */
static bool tip_robust(struct tip_poses *poses, struct tip_solution *solution)
{
	int m = poses->n < SAMPLE_MAX ? poses->n : SAMPLE_MAX;
	struct tip_poses sample = *poses; /* shares the scratch of the whole */
	bool whole = m == poses->n, changed = true;
	int n;

	if (!tip_solve(poses, NULL, poses->n, solution))
		return false;
	if (!whole)
		sample.pose = malloc((size_t)m * sizeof(*sample.pose));
	sample.n = m;
	for (int i = 0; !whole && sample.pose && i < m; i++)
		sample.pose[i] = poses->pose[(int64_t)i * poses->n / m];
	if (sample.pose)
		search_calibrate_tip(&sample, solution);
	if (!whole)
		free(sample.pose);
	for (int step = 0; step < STEPS && changed; step++) {
		double scale, limit;

		tip_residuals(poses, solution);
		scale = sqrt(quantile(poses, poses->n / 2)) / MEDIAN_LENGTH;
		/* exact data have no scale; rounding has */
		limit = FAR * scale + 1e-9;
		changed = !step;
		for (int i = 0; i < poses->n; i++) {
			bool in = poses->pose[i].square <= limit * limit;

			changed |= in != poses->pose[i].in;
			poses->pose[i].in = in;
		}
		n = tip_listed(poses);
		if (!tip_solve(poses, poses->list, n, solution))
			return false;
	}
	tip_residuals(poses, solution);
	return true;
}

/* --- motion: angles that directions of the sensor swept --- */

#define DIRECTIONS_MAX 1500 /* compared each with each */

/* Shortest tip that gives the direction of the tool; a shorter one is a correction. */
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
		tip_turn(to[m++], poses->pose[poses->list[i]].r, axis);
	for (int i = 0; i < m; i++)
		for (int j = 0; j < i; j++)
			least = fmin(least, v3_dot(to[i], to[j]));
	free(to);
	return acos(fmax(-1, least)) * 180 / M_PI;
}

/* Angles that the n listed poses swept, and how well they fix the tip. */
static void tip_motion(const struct tip_poses *poses, int n, const struct tip_solution *s,
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

/*
 * --- uncertainty ---
 *
 * The covariance, for noise that may last from pose to pose, and the motion of the pivot.
 */

#define ROUNDING_MM 1e-9
#define BLOCK_TIMES 4

/* Autocorrelation time of the residuals, in poses; 1 where each stands for itself. */
static double time_of(const struct tip_poses *poses, int n)
{
	double zero = 0, time = 1, noise = 3 / sqrt(3.0 * n);

	for (int i = 0; i < n; i++)
		zero += poses->pose[poses->list[i]].square;
	if (zero < n * ROUNDING_MM * ROUNDING_MM)
		return 1;
	for (int lag = 1; lag <= n / 10; lag++) {
		double sum = 0;

		for (int i = lag; i < n; i++)
			sum += v3_dot(poses->pose[poses->list[i]].residual,
				      poses->pose[poses->list[i - lag]].residual);
		if (sum / zero < noise)
			break;
		time += 2 * sum / zero;
	}
	return time;
}

/* Poses in a row that count as one: of noise that lasts, some times as long. */
static int tip_block(const struct tip_poses *poses, int n)
{
	double time = time_of(poses, n);

	return time > 1 ? (int)ceil(BLOCK_TIMES * time) : 1;
}

/*
 * Factor by which a variance from sums over blocks is too small: borders between blocks cut
 * off half a time each (Flegal and Jones, Ann. Stat. 38, 2010), six unknowns are two poses'
 * worth of equations, and few blocks have Student's tails, which k = 2 is to hold too.
 */
static double correction(int block, int blocks)
{
	double freedom = fmax(1, blocks - 2), student = 1 + 1.21 / freedom;
	double border = block > 1 ? 1 / (1 - 0.5 / BLOCK_TIMES) : 1;

	return blocks / freedom * border * student * student;
}

/*
 * Least squares of the residuals by a correction of t and, with 6 unknowns, the pivot's move
 * per half of the run, w; their covariance is a sandwich.
 */
struct sandwich {
	int m; /* unknowns, 3 or 6 */
	double left[36], middle[36], x[6];
};

/* u: times of the listed poses, in halves of the run, that add up to 0. */
static void score_rows(double rows[3][6], const struct tip_poses *poses, int at,
		       const struct tip_solution *s, double u)
{
	for (int e = 0; e < 3; e++)
		for (int k = 0; k < 3; k++) {
			rows[e][k] = poses->pose[at].r[3 * e + k] - s->mean_r[3 * e + k];
			rows[e][3 + k] = e == k ? -u : 0;
		}
}

/* x, and the residuals that it leaves. False: singular. */
static bool correct(struct tip_poses *poses, int n, const double *u,
		    const struct tip_solution *s, struct sandwich *w)
{
	int m = w->m;

	for (int i = 0; i < n; i++) {
		const double *r = poses->pose[poses->list[i]].residual;
		double rows[3][6];

		score_rows(rows, poses, poses->list[i], s, u[i]);
		for (int e = 0; e < 3; e++)
			for (int a = 0; a < m; a++) {
				w->x[a] -= rows[e][a] * r[e];
				for (int b = 0; b < m; b++)
					w->left[a * m + b] += rows[e][a] * rows[e][b];
			}
	}
	if (!incise_cholesky(w->left, m))
		return false;
	incise_cholesky_solve(w->left, m, w->x);
	for (int i = 0; i < n; i++) {
		double *r = poses->pose[poses->list[i]].residual, rows[3][6];

		score_rows(rows, poses, poses->list[i], s, u[i]);
		for (int e = 0; e < 3; e++)
			for (int a = 0; a < m; a++)
				r[e] += rows[e][a] * w->x[a];
		poses->pose[poses->list[i]].square = v3_dot(r, r);
	}
	return true;
}

/* The covariance of x into middle, by blocks of the residuals. */
static void sandwich(const struct tip_poses *poses, int n, const double *u,
		     const struct tip_solution *s, int block, struct sandwich *w)
{
	int m = w->m, blocks = n / block;
	double sum[6] = {0};

	for (int i = 0; i < n; i++) {
		const double *r = poses->pose[poses->list[i]].residual;
		double rows[3][6];

		score_rows(rows, poses, poses->list[i], s, u[i]);
		for (int e = 0; e < 3; e++)
			for (int a = 0; a < m; a++)
				sum[a] += rows[e][a] * r[e];
		/* the remainder belongs to the last block */
		if (i != n - 1 && ((i + 1) % block || (i + 1) / block == blocks))
			continue;
		for (int a = 0; a < m; a++)
			for (int b = 0; b < m; b++)
				w->middle[a * m + b] += sum[a] * sum[b];
		memset(sum, 0, sizeof(sum));
	}
	/* middle = left⁻¹ middle left⁻¹, symmetric in between once it is transposed */
	for (int side = 0; side < 2; side++) {
		for (int a = 0; a < m; a++)
			incise_cholesky_solve(w->left, m, w->middle + a * m);
		for (int a = 0; a < m; a++)
			for (int b = 0; b < a; b++) {
				double keep = w->middle[a * m + b];

				w->middle[a * m + b] = w->middle[b * m + a];
				w->middle[b * m + a] = keep;
			}
	}
	for (int i = 0; i < m * m; i++)
		w->middle[i] *= correction(block, blocks);
}

/* The solution's covariance, by blocks of the residuals, which stay as they are. */
static void tip_covariance(struct tip_poses *poses, int n, const double *u,
			   const struct tip_solution *s, struct incise_tip_fit *fit)
{
	struct sandwich still = {.m = 3};

	fit->block = tip_block(poses, n);
	fit->blocks = n / fit->block;
	if (!correct(poses, n, u, s, &still))
		return;
	sandwich(poses, n, u, s, fit->block, &still);
	memcpy(fit->covariance, still.middle, sizeof(fit->covariance));
}

/*
 * The way that the pivot moved, and its χ². Its blocks are those of what the move leaves: a
 * pivot that moves evenly makes all residuals alike, and left in them it would leave two
 * blocks, whose covariance is singular. Too few blocks have no χ²: 0.
 */
static void tip_move(struct tip_poses *poses, int n, const double *u,
		     const struct tip_solution *s, struct incise_tip_fit *fit,
		     double *chi2)
{
	struct sandwich moving = {.m = 6};
	double c[9], move[3];
	int block;

	*chi2 = 0;
	if (!correct(poses, n, u, s, &moving))
		return;
	block = tip_block(poses, n);
	sandwich(poses, n, u, s, block, &moving);
	for (int a = 0; a < 3; a++)
		for (int b = 0; b < 3; b++)
			c[3 * a + b] = moving.middle[(3 + a) * 6 + 3 + b];
	v3_copy(move, moving.x + 3);
	fit->moved_mm = 2 * v3_length(move);
	fit->moved_sd_mm = 2 * sqrt((c[0] + c[4] + c[8]) / 3);
	if (n / block >= INCISE_TIP_POSES_MIN && incise_cholesky(c, 3)) {
		incise_cholesky_solve(c, 3, move);
		*chi2 = v3_dot(move, moving.x + 3);
	}
}

/* --- judgement --- */

#define OUTLIERS_MAX 0.3
#define METRES_TIP_MM 1.0
#define METRES_RMS_MM 0.002
#define RMS_MAX_MM 1.0
#define CHI2_MOVED 16.27 /* of three, which chance exceeds once in 1000 */
#define MOVED_MIN_MM 0.1

/* True if the poses left out lie together at an end: the pivot moved there. */
static bool outliers_at_end(const struct tip_poses *poses)
{
	int outliers = 0, late = 0;

	for (int i = 0; i < poses->n; i++)
		if (!poses->pose[i].in) {
			outliers++;
			late += i >= poses->n / 2;
		}
	return late > 0.8 * outliers || late < 0.2 * outliers;
}

/* Refuse a fit that is not to be trusted. 0; -EDOM. */
static int tip_judge(const struct tip_poses *poses, const struct incise_tip_fit *fit,
		     double chi2, struct incise_error *err)
{
	if (fit->least_deg < INCISE_TIP_LEAST_DEG)
		return incise_error_set(
			err, EDOM,
			"the tool rotated about one axis only: the direction (%.2f "
			"%.2f %.2f) of the sensor swept %.0f degrees; rotate it in all "
			"directions",
			fit->least[0], fit->least[1], fit->least[2], fit->least_deg);
	/* No tracker measures so, and hardly a tip is so near to its sensor. */
	if (v3_length(fit->tip_mm) < METRES_TIP_MM && fit->rms_mm < METRES_RMS_MM)
		return incise_error_set(
			err, EDOM,
			"a tip %.3g mm from the sensor, and residuals of %.2g mm: the "
			"positions seem to be in m; multiply them by 1000",
			v3_length(fit->tip_mm), fit->rms_mm);
	if (fit->n - fit->inliers > OUTLIERS_MAX * fit->n) {
		if (outliers_at_end(poses))
			return incise_error_set(
				err, EDOM,
				"the pivot moved: %d of %d poses have another pivot "
				"than the rest; keep the tip in its dimple",
				fit->n - fit->inliers, fit->n);
		return incise_error_set(
			err, EDOM,
			"%d of %d poses have another pivot than the rest; keep the tip "
			"in its dimple, and check the order of the columns",
			fit->n - fit->inliers, fit->n);
	}
	if (fit->rms_mm > RMS_MAX_MM)
		return incise_error_set(
			err, EDOM,
			"poses miss their pivot by %.2f mm rms, more than %g mm; keep "
			"the tip in its dimple, and check the order of the columns "
			"(quaternion w first)",
			fit->rms_mm, RMS_MAX_MM);
	if (fit->cone_deg < INCISE_TIP_CONE_DEG)
		return incise_error_set(
			err, EDOM,
			"the tool swept a cone of only %.0f degrees; at least %g are "
			"required",
			fit->cone_deg, INCISE_TIP_CONE_DEG);
	if (chi2 > CHI2_MOVED && fit->moved_mm > MOVED_MIN_MM)
		return incise_error_set(
			err, EDOM,
			"the pivot moved by %.2f mm during the rotation; keep the tip "
			"in its dimple, and the dimple in place",
			fit->moved_mm);
	if (fit->blocks < INCISE_TIP_POSES_MIN)
		return incise_error_set(
			err, EDOM,
			"%d poses correspond to %d independent ones, %d are required; "
			"rotate the tool longer",
			fit->n, fit->blocks, INCISE_TIP_POSES_MIN);
	return 0;
}

/* --- the whole --- */

/* Rotation matrix; columns are the turned axes. */
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

static int take_calibrate_tip(struct tip_poses *to, const struct incise_tip_pose *from,
			      struct incise_error *err)
{
	for (int i = 0; i < to->n; i++) {
		const double *q = from[i].quaternion;
		double length = sqrt(q[0] * q[0] + v3_dot(q + 1, q + 1));

		if (!v3_finite(from[i].position_mm) || !isfinite(length) ||
		    v3_length(from[i].position_mm) > 1e6)
			return incise_error_set(err, EINVAL,
						"pose %d: not finite, or not a "
						"position of a tool; remove it",
						i + 1);
		if (fabs(length - 1) > 0.02)
			return incise_error_set(err, EINVAL,
						"pose %d: the quaternion's length is "
						"%.3g, not 1; check the order of the "
						"columns",
						i + 1, length);
		v3_copy(to->pose[i].p, from[i].position_mm);
		rotation(to->pose[i].r, q);
	}
	return 0;
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
				sum += poses->pose[poses->list[i]].square;
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
			"the tool did not rotate, or about one axis only; rotate it in "
			"all directions, with the tip in its dimple");
	n = fit->inliers = tip_listed(poses);
	v3_copy(fit->tip_mm, s.t);
	v3_copy(fit->pivot_mm, s.c);
	for (int i = 0; i < n; i++) {
		sum += poses->pose[poses->list[i]].square;
		fit->largest_mm =
			fmax(fit->largest_mm, sqrt(poses->pose[poses->list[i]].square));
	}
	fit->rms_mm = sqrt(sum / n);
	tip_motion(poses, n, &s, fit);
	u = malloc((size_t)n * sizeof(*u));
	if (!u)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int i = 0; i < n; i++) {
		/* as doubles, for their difference may not fit its type */
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
	tip_covariance(poses, n, u, &s, fit);
	tip_move(poses, n, u, &s, fit, &chi2);
	free(u);
	fit->held_out_mm = held_out(poses, n);
	return tip_judge(poses, fit, chi2, err);
}

int incise_calibrate_tip(const struct incise_tip_pose *poses, int n, bool *inlier,
			 struct incise_tip_fit *fit, struct incise_error *err)
{
	struct tip_poses own = {.n = n};
	int rc;

	*fit = (struct incise_tip_fit){.n = n};
	if (inlier)
		memset(inlier, 0, (size_t)(n > 0 ? n : 0) * sizeof(*inlier));
	if (n < INCISE_TIP_POSES_MIN)
		return incise_error_set(err, EDOM,
					"%d poses are too few, at least %d are "
					"required; rotate the tool longer",
					n, INCISE_TIP_POSES_MIN);
	own.pose = calloc((size_t)n, sizeof(*own.pose));
	own.list = malloc((size_t)n * sizeof(*own.list));
	own.sorted = malloc((size_t)n * sizeof(*own.sorted));
	rc = own.pose && own.list && own.sorted
		     ? take_calibrate_tip(&own, poses, err)
		     : incise_error_set(err, ENOMEM, "out of memory");
	if (!rc)
		rc = fit_poses(&own, poses, fit, err);
	for (int i = 0; inlier && own.pose && i < n; i++)
		inlier[i] = own.pose[i].in;
	free(own.pose);
	free(own.list);
	free(own.sorted);
	return rc;
}
