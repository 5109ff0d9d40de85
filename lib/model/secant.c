// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Searching for the steepest secants: points spread evenly over the box, then from the
 * best of them uphill by steps along the inputs that grow shorter; see secant.h.
 */
#include <math.h>
#include <string.h>
#include "secant.h"

/* The first step uphill as a share of the box, and how often it is halved. */
#define FIRST_STEP (1.0 / 16)
#define HALVINGS 8

/* Uphill from more than one point, for there may be more than one hill. */
#define STARTS 4

/* A point and the slope there, negated where the lowest is sought. */
struct place {
	double slope;
	double x[INCISE_MODEL_INPUTS_MAX];
};

/*
 * Fractions of k·φ^-1, k·φ^-2 … for the φ > 1 with φ^(n+1) = φ + 1, the golden ratio for
 * n = 1: they leave no large gap in n dimensions, for any number of points.
 */
static void even_steps(double *step, int n)
{
	double phi = 2, power = 1;

	for (int k = 0; k < 64; k++)
		phi = pow(1 + phi, 1.0 / (n + 1));
	for (int i = 0; i < n; i++) {
		power /= phi;
		step[i] = power;
	}
}

static double climb(const struct incise_secant *s, int input, double sign,
		    struct place *place)
{
	/* Both ends' climbs together ask as often as the points before them. */
	int left = s->n_points / (2 * STARTS);
	double share = FIRST_STEP;

	for (int halving = 0; halving < HALVINGS && left > 0;) {
		struct place best = *place;

		for (int k = 0; k < 2 * s->n_inputs; k++) {
			struct place next = *place;
			int i = k / 2;
			double by = (s->max[i] - s->min[i]) * share;

			next.x[i] += k % 2 ? by : -by;
			next.x[i] = fmax(s->min[i], fmin(s->max[i], next.x[i]));
			next.slope = sign * s->slope(s->of, next.x, input);
			left--;
			if (next.slope > best.slope)
				best = next;
		}
		if (best.slope > place->slope) {
			*place = best;
			continue;
		}
		share /= 2;
		halving++;
	}
	return place->slope;
}

/* Keep the best, the steepest first. */
static void keep(struct place *best, const struct place *place)
{
	int k = STARTS;

	while (k > 0 && !(best[k - 1].slope >= place->slope))
		k--;
	if (k == STARTS)
		return;
	memmove(&best[k + 1], &best[k], (size_t)(STARTS - 1 - k) * sizeof(*best));
	best[k] = *place;
}

static void search(const struct incise_secant *s, int input, struct incise_slope *slope)
{
	struct place best[2][STARTS];
	double step[INCISE_MODEL_INPUTS_MAX];

	even_steps(step, s->n_inputs);
	for (int k = 0; k < STARTS; k++) {
		best[0][k].slope = -INFINITY;
		memcpy(best[0][k].x, s->min, sizeof(s->min));
		best[1][k] = best[0][k];
	}
	for (int k = 0; k < s->n_points; k++) {
		struct place place;

		for (int i = 0; i < s->n_inputs; i++) {
			double u = fmod(0.5 + k * step[i], 1);

			place.x[i] = s->min[i] * (1 - u) + s->max[i] * u;
		}
		place.slope = s->slope(s->of, place.x, input);
		keep(best[1], &place);
		place.slope = -place.slope;
		keep(best[0], &place);
	}
	*slope = (struct incise_slope){INFINITY, -INFINITY, false};
	for (int k = 0; k < STARTS; k++) {
		slope->lowest = fmin(slope->lowest, -climb(s, input, -1, &best[0][k]));
		slope->highest = fmax(slope->highest, climb(s, input, 1, &best[1][k]));
	}
}

void incise_secant_search(const struct incise_secant *secant, struct incise_slope *slopes)
{
	for (int i = 0; i < secant->n_inputs; i++)
		search(secant, i, &slopes[i]);
}
