// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Two streams on one grid of 4 ms, and their derivatives through a Gaussian; see delay_grid.h.
 *
 *   quick stream   ·····|·····|·····     mean of what is within half a step
 *   slow stream      o     o     o       cubic through four neighbours
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "delay_grid.h"

#define NS_PER_STEP 4000000LL
#define TIME_MAX_NS (INT64_MAX / 4)
#define STEPS_MAX 150000 /* 10 minutes */

/* The filter passes what the slower stream can carry, and no more than a hand can do. */
#define SIGMA_MIN_STEPS 2.0
#define SIGMA_PERIODS 0.8
#define REACH_SIGMAS 4
#define SPEED_REACH 12 /* ±48 ms: less noise than of ±20 ms, which biased by 0.18 ms */

#define GAP_PERIODS 4 /* farther apart, points leave the time between them open */

/* Median time between points, ns; negative where they do not ascend. */
static double period_of(const struct incise_delay_point *points, int n)
{
	int m = n - 1 < 1001 ? n - 1 : 1001;
	double steps[1001];

	/* so that differences of times fit their type */
	if (points[0].t_ns < -TIME_MAX_NS || points[n - 1].t_ns > TIME_MAX_NS)
		return -1;
	for (int i = 1; i < n; i++)
		if (points[i].t_ns <= points[i - 1].t_ns)
			return -1;
	for (int i = 0; i < m; i++) {
		int at = (int)((int64_t)i * (n - 1) / m);

		steps[i] = (double)(points[at + 1].t_ns - points[at].t_ns);
	}
	qsort(steps, (size_t)m, sizeof(*steps), ascending);
	return steps[m / 2];
}

/* Values at the middle of each step, on the line through the points within it: a mean alone
 * would depend on where they happen to lie. */
static void put_means(double *to, int n, int64_t start_ns,
		      const struct incise_delay_point *points, int n_points)
{
	int at = 0;

	for (int i = 0; i < n; i++) {
		int64_t middle_ns = start_ns + i * NS_PER_STEP;
		double sum = 0, time = 0, tt = 0, ty = 0;
		int first, count;

		while (at < n_points && points[at].t_ns < middle_ns - NS_PER_STEP / 2)
			at++;
		first = at;
		while (at < n_points && points[at].t_ns < middle_ns + NS_PER_STEP / 2) {
			sum += points[at].value; /* NAN stays */
			time += (double)(points[at].t_ns - middle_ns);
			at++;
		}
		count = at - first;
		to[i] = NAN;
		if (count < 2)
			continue;
		sum /= count;
		time /= count;
		for (int k = first; k < at; k++) {
			double t = (double)(points[k].t_ns - middle_ns) - time;

			tt += t * t;
			ty += t * (points[k].value - sum);
		}
		if (fabs(time) < NS_PER_STEP / 8.0)
			to[i] = sum - ty / tt * time;
	}
}

static double lagrange(const struct incise_delay_point *p, int64_t t_ns)
{
	double sum = 0;

	for (int i = 0; i < 4; i++) {
		double share = 1;

		for (int j = 0; j < 4; j++)
			if (j != i)
				share *= (double)(t_ns - p[j].t_ns) /
					 (double)(p[i].t_ns - p[j].t_ns);
		sum += share * p[i].value;
	}
	return sum;
}

static void put_cubics(double *to, int n, int64_t start_ns,
		       const struct incise_delay_point *points, int n_points,
		       double period_ns)
{
	int at = 0; /* of the last point before */

	for (int i = 0; i < n; i++) {
		int64_t t_ns = start_ns + i * NS_PER_STEP;

		while (at < n_points - 1 && points[at + 1].t_ns <= t_ns)
			at++;
		to[i] = NAN;
		if (at < 1 || at > n_points - 3)
			continue;
		if ((double)(points[at + 2].t_ns - points[at - 1].t_ns) <
		    (2 + GAP_PERIODS) * period_ns)
			to[i] = lagrange(points + at - 1, t_ns);
	}
}

static void put_delay_grid(double *to, int n, int64_t start_ns,
			   const struct incise_delay_point *points, int n_points,
			   double period_ns)
{
	if (period_ns < NS_PER_STEP / 4.0)
		put_means(to, n, start_ns, points, n_points);
	else
		put_cubics(to, n, start_ns, points, n_points, period_ns);
}

void delay_grid_filter(const struct delay_grid *grid, const double *from, double *to)
{
	int reach = grid->reach;

	for (int i = 0; i < grid->n; i++)
		to[i] = 0;
	for (int i = reach; i < grid->n - reach; i++) {
		double sum = 0;

		/* odd, so half of it is enough */
		for (int k = 1; k <= reach; k++)
			sum += grid->weight[reach + k] * (from[i + k] - from[i - k]);
		to[i] = sum;
	}
}

double delay_grid_at(const double *column, int i, double shift)
{
	double whole = floor(shift), u = shift - whole;
	const double *p = column + i + (int)whole;

	/* cubic through four */
	return -u * (u - 1) * (u - 2) / 6 * p[-1] +
	       (u + 1) * (u - 1) * (u - 2) / 2 * p[0] - (u + 1) * u * (u - 2) / 2 * p[1] +
	       (u + 1) * u * (u - 1) / 6 * p[2];
}

/* Missing values become 0, and rows that a filter reaches from them are not good. */
static void mark_good(struct delay_grid *grid)
{
	double *streams[] = {grid->motion, grid->other};

	int reach = grid->reach + SPEED_REACH;

	for (int i = 0; i < grid->n; i++)
		grid->good[i] = i >= reach && i < grid->n - reach;
	for (int s = 0; s < 2; s++)
		for (int i = 0; i < grid->n; i++) {
			if (isfinite(streams[s][i]))
				continue;
			streams[s][i] = 0;
			for (int k = -reach; k <= reach; k++)
				if (i + k >= 0 && i + k < grid->n)
					grid->good[i + k] = false;
		}
}

/*
 * Derivative of a cubic through 2·SPEED_REACH + 1 steps about each (Savitzky and Golay, Anal.
 * Chem. 36, 1964): it is exact for slow motion, so that viscosity is not mistaken.
 */
static void make_speed(struct delay_grid *grid)
{
	double s2 = 0, s4 = 0, s6 = 0, weight[SPEED_REACH + 1];

	for (int k = 1; k <= SPEED_REACH; k++) {
		s2 += 2 * pow(k, 2);
		s4 += 2 * pow(k, 4);
		s6 += 2 * pow(k, 6);
	}
	for (int k = 1; k <= SPEED_REACH; k++)
		weight[k] = (s6 * k - s4 * pow(k, 3)) / (s2 * s6 - s4 * s4);
	for (int i = 0; i < grid->n; i++) {
		bool inside = i >= SPEED_REACH && i < grid->n - SPEED_REACH;
		double sum = 0;

		for (int k = 1; k <= SPEED_REACH && inside; k++)
			sum += weight[k] * (grid->motion[i + k] - grid->motion[i - k]);
		grid->speed[i] = sum / DELAY_STEP_S;
	}
}

static bool allocate(struct delay_grid *grid)
{
	const size_t n = (size_t)grid->n;
	double *values = malloc((5 + DELAY_COLUMNS) * n * sizeof(*values));

	grid->values = values;
	grid->good = malloc(n * sizeof(*grid->good));
	grid->weight = malloc((size_t)(2 * grid->reach + 1) * sizeof(double));
	if (!values || !grid->good || !grid->weight)
		return false;
	grid->motion = values;
	grid->speed = values + n;
	grid->other = values + 2 * n;
	grid->target = values + 3 * n;
	grid->scratch = values + 4 * n;
	for (int k = 0; k < DELAY_COLUMNS; k++)
		grid->column[k] = values + (5 + k) * n;
	return true;
}

void delay_grid_free(struct delay_grid *grid)
{
	free(grid->values);
	free(grid->good);
	free(grid->weight);
}

int delay_grid_make(struct delay_grid *grid, const struct incise_delay_point *motion,
		    int n_motion, const struct incise_delay_point *other, int n_other,
		    struct incise_error *err)
{
	double periods[2], sum = 0;
	int64_t end_ns;

	memset(grid, 0, sizeof(*grid));
	if (n_motion < 10 || n_other < 10)
		return incise_error_set(err, EDOM,
					"a stream of %d values is too short for a "
					"delay; record 10 to 15 s of motion",
					n_motion < n_other ? n_motion : n_other);
	periods[0] = period_of(motion, n_motion);
	periods[1] = period_of(other, n_other);
	if (periods[0] < 0 || periods[1] < 0)
		return incise_error_set(err, EINVAL,
					"times of a stream do not ascend, or are out "
					"of range; sort them");
	grid->start_ns = motion->t_ns > other->t_ns ? motion->t_ns : other->t_ns;
	end_ns = motion[n_motion - 1].t_ns < other[n_other - 1].t_ns
			 ? motion[n_motion - 1].t_ns
			 : other[n_other - 1].t_ns;
	if (end_ns - grid->start_ns < INCISE_DELAY_SPAN_MIN_S * 1e9)
		return incise_error_set(err, EDOM,
					"the streams have %.1f s in common, at least "
					"%g are required; record longer",
					fmax(0, (double)(end_ns - grid->start_ns) * 1e-9),
					INCISE_DELAY_SPAN_MIN_S);
	if ((end_ns - grid->start_ns) / NS_PER_STEP >= STEPS_MAX)
		return incise_error_set(err, EDOM,
					"the streams have more than 10 minutes in "
					"common; use a part of them");
	grid->n = (int)((end_ns - grid->start_ns) / NS_PER_STEP) + 1;
	grid->sigma = fmax(SIGMA_MIN_STEPS,
			   SIGMA_PERIODS * fmax(periods[0], periods[1]) / NS_PER_STEP);
	if (grid->sigma > 25)
		return incise_error_set(err, EDOM,
					"a stream has a value each %.0f ms, too slow "
					"for a delay; use a faster one",
					fmax(periods[0], periods[1]) * 1e-6);
	grid->reach = (int)ceil(REACH_SIGMAS * grid->sigma);
	if (!allocate(grid))
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int k = -grid->reach; k <= grid->reach; k++) {
		double w = k / grid->sigma;

		grid->weight[grid->reach + k] = k * exp(-w * w / 2);
		sum += k * grid->weight[grid->reach + k];
	}
	for (int k = 0; k <= 2 * grid->reach; k++)
		grid->weight[k] /= sum;
	put_delay_grid(grid->motion, grid->n, grid->start_ns, motion, n_motion,
		       periods[0]);
	put_delay_grid(grid->other, grid->n, grid->start_ns, other, n_other, periods[1]);
	mark_good(grid);
	delay_grid_filter(grid, grid->other, grid->target);
	make_speed(grid);
	return 0;
}
