// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A straight line in spite of outliers; see robust_line.h. Deterministic: with many points the
 * lines tried are a fixed choice.
 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include "../base/ascending.h"
#include "../base/random.h"
#include "robust_line.h"

/* Through every two of up to 150 points; of more points, so many lines. */
#define LINES_MAX (150 * 149 / 2)
#define LINES 1000
/* A good reading in 16000 lies as far off as this many sd. */
#define FAR 4.0

/*
 * The same in 16000, where the sd itself is of few others: Student's t for FAR, by D. L.
 * Wallace (Ann. Math. Stat. 30, 1959).
 */
static double far_of(int freedom)
{
	const double v = freedom, z = FAR * (8 * v + 3) / (8 * v + 1);

	return sqrt(v * expm1(z * z / v));
}

/*
 * Half of few points always lie on some line by luck, and make the others look far: so three
 * quarters are to be near it.
 */
static int quantile(int n)
{
	return n < 20 ? 3 * n / 4 : n / 2;
}

/* Median of |y - line|, or the quantile of few points; @scratch: n numbers. */
static double median_distance(const double *x, const double *y, int n, double slope,
			      double zero, double *scratch)
{
	for (int i = 0; i < n; i++)
		scratch[i] = fabs(y[i] - zero - slope * x[i]);
	qsort(scratch, n, sizeof(*scratch), ascending);
	return scratch[quantile(n)];
}

static void try_line(const double *x, const double *y, int n, int i, int j,
		     struct robust_line *line, double *best, double *scratch)
{
	double slope, zero, distance;

	if (x[i] == x[j])
		return;
	slope = (y[j] - y[i]) / (x[j] - x[i]);
	zero = y[i] - slope * x[i];
	distance = median_distance(x, y, n, slope, zero, scratch);
	if (distance < *best) {
		*best = distance;
		line->slope = slope;
		line->zero = zero;
	}
}

/* Least squares of the points that are no outliers; false: they have no line. */
static bool least_squares(const double *x, const double *y, int n, const bool *outlier,
			  struct robust_line *line, double *far)
{
	double mx = 0, my = 0, xx = 0, xy = 0, rr = 0;
	int m = 0;

	for (int i = 0; i < n; i++)
		if (!outlier[i]) {
			m++;
			mx += (x[i] - mx) / m;
			my += (y[i] - my) / m;
		}
	for (int i = 0; i < n; i++)
		if (!outlier[i]) {
			xx += (x[i] - mx) * (x[i] - mx);
			xy += (x[i] - mx) * (y[i] - my);
		}
	if (m < 3 || !(xx > 0))
		return false;
	line->slope = xy / xx;
	line->zero = my - line->slope * mx;
	for (int i = 0; i < n; i++)
		if (!outlier[i]) {
			double r = y[i] - line->zero - line->slope * x[i];

			rr += r * r;
		}
	line->sd = sqrt(rr / (m - 2));
	*far = far_of(m - 2);
	return true;
}

int incise_robust_line(const double *x, const double *y, int n, double sd_min,
		       struct robust_line *line, bool *outlier)
{
	double best = INFINITY, far = FAR, *scratch = malloc(n * sizeof(*scratch));
	uint64_t choice = 1;

	if (!scratch)
		return -ENOMEM;
	*line = (struct robust_line){0};
	if ((int64_t)n * (n - 1) / 2 <= LINES_MAX)
		for (int i = 0; i < n; i++)
			for (int j = 0; j < i; j++)
				try_line(x, y, n, i, j, line, &best, scratch);
	else
		for (int k = 0; k < LINES; k++) {
			int i = (int)incise_random_draw(&choice, n);
			int j = (int)incise_random_draw(&choice, n);

			try_line(x, y, n, i, j, line, &best, scratch);
		}
	free(scratch);
	if (!isfinite(best))
		return -EDOM;
	/* Rousseeuw and Leroy 1987, chapter 5: to an sd of normal errors, for small n too. */
	line->sd = (n < 20 ? 0.869 : 1.4826) * (1 + 5.0 / (n > 2 ? n - 2 : 1)) * best;
	for (int round = 0; round < 10; round++) {
		const double limit = hypot(far * line->sd, FAR * sd_min);

		for (int i = 0; i < n; i++)
			outlier[i] = fabs(y[i] - line->zero - line->slope * x[i]) > limit;
		if (!least_squares(x, y, n, outlier, line, &far))
			return -EDOM;
	}
	return 0;
}