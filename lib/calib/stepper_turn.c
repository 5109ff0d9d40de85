// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What happens behind the turns of an actuator: how far the force stands still, how far it
 * leaps, and how the rest fades, from all turns together. s is the way since the turn, and
 * rho how far the force is behind its branch's line, on the side that it came from:
 *
 *   rho   k(s - D) ____________ up to dead: the force stands still
 *                 /:leap
 *                / o.
 *               /  rest `.
 *   ----------D----dead----`.------- s
 *
 * Four models, the simple ones first: that turn is just the lines' distance D; a leap; a rest;
 * both. One with more in it has to explain much more.
 *
 * A part of one noun: tests/unit/calib/stepper.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include "stepper_work.h"

#define LOOK 0.4 /* behind each turn, of the range */
/* Tried first, of that; then finer about the best. */
#define DEAD_GRAIN 0.025
#define FADE_GRAIN 1.5
#define ABOUT 1
#define MOMENTS 2000 /* looked at */
/* Chi² that one more thing in the model has to take away; with the search it is rarely 12. */
#define WORTH 25.0

struct moment {
	double s, rho, D; /* mm, N, mm */
};

struct model {
	double chi2, dead_mm, rest_N, fade_mm, sum; /* sum: of the fading's squares */
};

static int by_way(const void *a, const void *b)
{
	double x = ((const struct moment *)a)->s, y = ((const struct moment *)b)->s;

	return (x > y) - (x < y);
}

/* Lines of two strokes that meet: how far apart, in mm of travel that is lost. */
static double apart_mm(const struct stepper_work *w, int k)
{
	return w->strokes[k].way * (w->strokes[k - 1].zero_N - w->strokes[k].zero_N) /
	       w->slope;
}

/* Points behind all turns but the first stroke's, whose turn nobody has seen. */
static int gather(const struct stepper_work *w, double far_mm, struct moment *moments)
{
	int m = 0;

	for (int k = 1; k < w->n_strokes; k++) {
		const struct stroke *s = &w->strokes[k];
		double D = apart_mm(w, k);

		for (int i = s->first; i <= s->last; i++) {
			double gone = s->way * (w->points[i].position_mm - s->from_mm);

			if (gone <= far_mm &&
			    w->states[i] != INCISE_CALIBRATE_STEPPER_SATURATED &&
			    w->states[i] != INCISE_CALIBRATE_STEPPER_OUTLIER)
				moments[m++] = (struct moment){
					gone, -s->way * incise_stepper_off(w, s, i), D};
		}
	}
	qsort(moments, m, sizeof(*moments), by_way);
	/* So many tell as much, and the search goes over them a few thousand times. */
	if (m > MOMENTS) {
		for (int i = 0; i < MOMENTS; i++)
			moments[i] = moments[(int64_t)i * m / MOMENTS];
		m = MOMENTS;
	}
	return m;
}

/* An outlier behind a turn must not decide alone. */
static double square(double off, double sd)
{
	double far = 5 * sd;

	return fabs(off) > far ? 2 * far * fabs(off) - far * far : off * off;
}

/*
 * With the force standing still up to @dead and a rest that fades on @fade (0: none). A
 * @leap is to be there or not: without one the rest is what the dead travel leaves.
 */
static struct model try_model(const struct stepper_work *w, const struct moment *moments,
			      int m, double D, double dead, double fade, bool leap)
{
	struct model model = {.dead_mm = dead, .fade_mm = fade};
	const double most_N = w->slope * (dead - D);
	const double by_mm = fade > 0 ? 1 / fade : 0;
	double sum_ff = 0, sum_rf = 0;

	for (int i = 0; i < m && fade > 0; i++) {
		/* Where the sensor drifts, turns lie apart. */
		double behind = moments[i].s - dead - (moments[i].D - D);

		if (behind > 0 && behind < fade) {
			double f = 1 - behind * by_mm;

			sum_ff += f * f;
			sum_rf += f * moments[i].rho;
		}
	}
	model.sum = sum_ff;
	if (fade > 0 && leap)
		model.rest_N = sum_ff > 0 ? fmin(sum_rf / sum_ff, most_N) : 0;
	else if (fade > 0)
		model.rest_N = most_N;
	for (int i = 0; i < m; i++) {
		const struct moment *at = &moments[i];
		double behind = at->s - dead - (at->D - D);
		double f = fade > 0 ? fmax(0, 1 - behind * by_mm) : 0;

		model.chi2 += square(behind <= 0 ? at->rho - w->slope * (at->s - at->D)
						 : at->rho - model.rest_N * f,
				     w->sd);
	}
	return model;
}

/* Of dead travels and fades about @from, so far apart, the best. */
static void try_about(const struct stepper_work *w, const struct moment *moments, int m,
		      double D, bool leap, double least_mm, struct model from,
		      double wide, struct model *best)
{
	const double far_mm = LOOK * w->range_mm;

	for (int i = -ABOUT; i <= ABOUT; i++)
		for (int j = -ABOUT; j <= ABOUT; j++) {
			double dead = from.dead_mm + i * wide * DEAD_GRAIN * far_mm;
			double fade = from.fade_mm * pow(FADE_GRAIN, j * wide);
			struct model model;

			if (dead < 0 || dead + fade > far_mm ||
			    (leap && dead < D && !fade))
				continue;
			if (!from.fade_mm && j)
				continue;
			/* What fades within a few points is a leap; along the dead
			 * travel's own slope it is dead travel. */
			if (from.fade_mm > 0 &&
			    (fade < least_mm || fade < 2 * (D - dead)))
				continue;
			model = try_model(w, moments, m, D, dead, fade, leap);
			if (model.chi2 < best->chi2)
				*best = model;
		}
}

static struct model search(const struct stepper_work *w, const struct moment *moments,
			   int m, double D, double least_mm, bool leap, bool rest)
{
	const double far_mm = LOOK * w->range_mm;
	struct model best = {.chi2 = INFINITY};

	for (double dead = 0; dead < 0.7; dead += DEAD_GRAIN)
		for (double fade = 0.02; fade < 0.7; fade *= FADE_GRAIN) {
			struct model at = {.dead_mm = dead * far_mm,
					   .fade_mm = rest ? fade * far_mm : 0};

			try_about(w, moments, m, D, leap, least_mm, at, 0, &best);
			if (!rest)
				break;
		}
	for (double wide = 0.5; wide > 0.02 && best.chi2 < INFINITY; wide *= 0.5)
		try_about(w, moments, m, D, leap, least_mm, best, wide, &best);
	return best;
}

int incise_stepper_turn(const struct stepper_work *w,
			struct incise_calibrate_stepper *result)
{
	struct moment *moments = malloc(w->n * sizeof(*moments));
	double D[2] = {0, 0}, mean_mm, spacing, u_D2 = 0, u_rest, worth;
	int turns[2] = {0, 0}, m;
	struct model plain, leap, rest, both, unseen, *best = &plain;

	if (!moments)
		return -ENOMEM;
	/* Turns of both ways weigh alike, so that a drift cancels. */
	for (int k = 1; k < w->n_strokes; k++) {
		int way = w->strokes[k].way > 0;

		D[way] += (apart_mm(w, k) - D[way]) / ++turns[way];
	}
	for (int k = 0; k < w->n_strokes; k++)
		u_D2 += 4 * w->sd * w->sd / w->strokes[k].used /
			((double)w->n_strokes * w->n_strokes);
	mean_mm = turns[0] && turns[1] ? (D[0] + D[1]) / 2 : D[0] + D[1];
	m = gather(w, LOOK * w->range_mm, moments);
	spacing = m > 1 ? (moments[m - 1].s - moments[0].s) * (w->n_strokes - 1) / m : 0;
	plain = try_model(w, moments, m, mean_mm, fmax(mean_mm, 0), 0, true);
	leap = search(w, moments, m, mean_mm, 0, true, false);
	rest = search(w, moments, m, mean_mm, 4 * spacing, false, true);
	both = search(w, moments, m, mean_mm, 4 * spacing, true, true);
	/* means of readings are no better than their last digit */
	worth = WORTH * (w->sd * w->sd + pow(w->setup->resolution_N, 2) / 12);
	if (leap.chi2 < best->chi2 - worth)
		best = &leap;
	if (rest.chi2 < (best == &plain ? plain.chi2 - worth : best->chi2 - worth / 2))
		best = &rest;
	if (both.chi2 < best->chi2 - worth)
		best = &both;
	result->branches_mm = mean_mm;
	result->dead_mm = best->dead_mm;
	result->rest_N = best->rest_N;
	result->rest_mm = best->fade_mm;
	result->stiction_N = 0;
	if (best == &leap || best == &both)
		result->stiction_N =
			fmax(0, w->slope * (best->dead_mm - mean_mm) - best->rest_N);
	/* Without a leap the rest hangs on where the force begins to change. */
	/* One that is too small to be seen may be there still; twice: its fading is not known. */
	unseen = try_model(w, moments, m, mean_mm, best->dead_mm, 0.05 * w->range_mm,
			   true);
	u_rest = best->sum > 0 ? 2 * w->sd / sqrt(best->sum)
			       : sqrt(worth / 3) / sqrt(fmax(unseen.sum, 1));
	free(moments);
	/* The end of the dead travel lies somewhere between two points. */
	if (best == &rest)
		u_rest = hypot(u_rest, w->slope * spacing / sqrt(12));
	if (best == &both)
		u_rest = hypot(u_rest, best->rest_N / best->fade_mm * spacing);
	result->backlash_mm = fmax(0, mean_mm + best->rest_N / w->slope);
	result->hysteresis_N = fabs(best->rest_N);
	result->hysteresis_u_N = hypot(u_rest, result->hysteresis_N * w->setup->sensor_u);
	result->stiction_u_N = hypot(hypot(w->slope * spacing / sqrt(12), u_rest),
				     result->stiction_N * w->setup->sensor_u);
	result->backlash_u_mm =
		sqrt(u_D2 / (w->slope * w->slope) + pow(w->setup->step_mm, 2) / 12);
	result->backlash_u_mm = hypot(result->backlash_u_mm, u_rest / w->slope);
	return 0;
}
