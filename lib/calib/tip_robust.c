// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which poses are about one pivot: least trimmed squares by concentration steps (Rousseeuw
 * and Van Driessen, Data Min. Knowl. Discov. 12, 2006), then all that are near it.
 *
 * A part of one noun: tests/unit/calib/tip.c tests it through its door.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "tip.h"

#define STARTS 60
#define FINALISTS 5
#define START_POSES 4  /* two fix five of the six unknowns, three all: one to spare */
#define SAMPLE_MAX 200 /* poses that the search looks at */
#define SHARE 0.6      /* of them that are fitted */
#define STEPS 10

/*
 * Median of the length of three normal deviates. Where noise is larger across the tool,
 * lengths are those of two: 5 scales are then 3.8 sd, which one good pose in 1500 exceeds.
 */
#define MEDIAN_LENGTH 1.538
#define FAR 5.0

/* The same sequence each time: a fit is to be repeatable. */
static unsigned int draw(uint64_t *state, unsigned int n)
{
	*state = *state * 6364136223846793005u + 1442695040888963407u;
	return (unsigned int)((*state >> 33) % n);
}

static double quantile(struct tip_poses *sample, int at)
{
	memcpy(sample->sorted, sample->square, (size_t)sample->n * sizeof(double));
	qsort(sample->sorted, (size_t)sample->n, sizeof(double), ascending);
	return sample->sorted[at];
}

/* Fit the nearest h, some times. The sum of their squares; HUGE_VAL: they fix nothing. */
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
			if (sample->square[i] <= limit) {
				sample->list[n++] = i;
				sum += sample->square[i];
			}
		if (!tip_solve(sample, sample->list, n, s))
			return HUGE_VAL;
	}
	return sum;
}

static void search(struct tip_poses *sample, struct tip_solution *best)
{
	struct tip_solution finalists[FINALISTS], s;
	double sums[FINALISTS], sum;
	int h = (int)ceil(SHARE * sample->n);
	uint64_t state = 1;

	for (int i = 0; i < FINALISTS; i++)
		sums[i] = HUGE_VAL;
	for (int start = 0; start < STARTS; start++) {
		int few[START_POSES], at = FINALISTS;

		for (int i = 0; i < START_POSES; i++)
			few[i] = (int)draw(&state, (unsigned int)sample->n);
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

int tip_listed(const struct tip_poses *poses)
{
	int n = 0;

	for (int i = 0; i < poses->n; i++)
		if (poses->in[i])
			poses->list[n++] = i;
	return n;
}

bool tip_robust(struct tip_poses *poses, struct tip_solution *solution)
{
	int m = poses->n < SAMPLE_MAX ? poses->n : SAMPLE_MAX;
	struct tip_poses sample = *poses; /* shares the scratch of the whole */
	double(*p)[3] = poses->p, (*r)[9] = poses->r;
	bool whole = m == poses->n, changed = true;
	int n;

	if (!tip_solve(poses, NULL, poses->n, solution))
		return false;
	if (!whole) {
		sample.p = malloc((size_t)m * sizeof(*p));
		sample.r = malloc((size_t)m * sizeof(*r));
	}
	sample.n = m;
	for (int i = 0; !whole && sample.p && sample.r && i < m; i++) {
		int from = (int)((int64_t)i * poses->n / m);

		memcpy(sample.p[i], p[from], sizeof(*p));
		memcpy(sample.r[i], r[from], sizeof(*r));
	}
	if (sample.p && sample.r)
		search(&sample, solution);
	if (!whole) {
		free(sample.p);
		free(sample.r);
	}
	for (int step = 0; step < STEPS && changed; step++) {
		double scale, limit;

		tip_residuals(poses, solution);
		scale = sqrt(quantile(poses, poses->n / 2)) / MEDIAN_LENGTH;
		/* exact data have no scale; rounding has */
		limit = FAR * scale + 1e-9;
		changed = !step;
		for (int i = 0; i < poses->n; i++) {
			bool in = poses->square[i] <= limit * limit;

			changed |= in != poses->in[i];
			poses->in[i] = in;
		}
		n = tip_listed(poses);
		if (!tip_solve(poses, poses->list, n, solution))
			return false;
	}
	tip_residuals(poses, solution);
	return true;
}
