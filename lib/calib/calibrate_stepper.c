// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The calibration of an actuator against a force sensor; see incise/calibrate_stepper.h.
 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/calibrate_stepper.h>
#include "../base/ascending.h"
#include "../base/random.h"
#include "chi2.h"

/* A run of points that go one way: first … last. */
struct stroke {
	int first, last, way; /* way: 1 up, -1 down */
	double from_mm;	      /* place of the turn before it */
	double zero_N;	      /* its line at 0 mm */
	double mean_mm;	      /* of the points used */
	int used;
};

struct calibrate_stepper_work {
	const struct incise_calibrate_stepper_point *points;
	const struct incise_calibrate_stepper_setup *setup;
	int n, n_strokes;
	struct stroke *strokes;
	enum incise_calibrate_stepper_state *states;
	double range_mm; /* of all positions */
	double slope;	 /* N/mm, of all lines */
	double sd;	 /* N */
	double sxx;	 /* Σ (x - its stroke's mean)² of the points used */
};

/*
 * --- lines ---
 *
 * Lines of one slope, one for each stroke, in spite of outliers: the median of the slopes of pairs
 * within strokes (P. K. Sen, J. Am. Stat. Assoc. 63, 1968), then least squares of the points near
 * it. A zero for each stroke takes up a sensor that drifts.
 */

#define PAIRS 4000
#define ROUNDS 10
/* A good reading in 150000 lies as far off as this many sd. */
#define FAR 4.5

/* Distance of a point from its stroke's line, N. */
static double off_line(const struct calibrate_stepper_work *w,
		       const struct stroke *stroke, int i)
{
	return w->points[i].force_N - stroke->zero_N -
	       w->slope * w->points[i].position_mm;
}

/* The larger of the middle two. */
static double upper_median(double *values, int n)
{
	qsort(values, n, sizeof(*values), ascending);
	return values[n / 2];
}

/* Use points behind the turns that are not saturated, until they prove to be far. */
static void choose_points(struct calibrate_stepper_work *w, double skip_mm)
{
	for (int k = 0; k < w->n_strokes; k++) {
		const struct stroke *s = &w->strokes[k];

		for (int i = s->first; i <= s->last; i++) {
			double gone_mm = s->way * (w->points[i].position_mm - s->from_mm);

			if (w->states[i] != INCISE_CALIBRATE_STEPPER_SATURATED)
				w->states[i] = gone_mm > skip_mm
						       ? INCISE_CALIBRATE_STEPPER_USED
						       : INCISE_CALIBRATE_STEPPER_TURN;
		}
	}
}

/* Slopes of pairs that are far apart, so that noise does not make them steep. */
static int slope_of_pairs(struct calibrate_stepper_work *w, double *scratch)
{
	uint64_t choice = 1;
	int n = 0;

	for (int tries = 0; tries < 4 * PAIRS && n < PAIRS; tries++) {
		const struct stroke *s =
			&w->strokes[incise_random_draw(&choice, w->n_strokes)];
		int length = s->last - s->first + 1;
		int i = s->first + (int)incise_random_draw(&choice, length);
		int j = s->first + (int)incise_random_draw(&choice, length);
		double mm = w->points[j].position_mm - w->points[i].position_mm;

		if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED &&
		    w->states[j] == INCISE_CALIBRATE_STEPPER_USED &&
		    fabs(mm) > 0.2 * w->range_mm)
			scratch[n++] = (w->points[j].force_N - w->points[i].force_N) / mm;
	}
	if (n < 10)
		return -EDOM;
	w->slope = upper_median(scratch, n);
	return 0;
}

/* The zero of each stroke, and the spread about the lines, by medians. */
static int medians(struct calibrate_stepper_work *w, double *scratch)
{
	int all = 0;

	for (int k = 0; k < w->n_strokes; k++) {
		struct stroke *s = &w->strokes[k];
		int n = 0;

		s->zero_N = 0;
		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED)
				scratch[n++] = off_line(w, s, i);
		if (n < 4)
			return -EDOM;
		s->zero_N = median(scratch, n);
	}
	for (int k = 0; k < w->n_strokes; k++)
		for (int i = w->strokes[k].first; i <= w->strokes[k].last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED)
				scratch[all++] = fabs(off_line(w, &w->strokes[k], i));
	w->sd = 1.4826 * upper_median(scratch, all);
	return 0;
}

static void drop_far(struct calibrate_stepper_work *w)
{
	/* Readings without any noise scatter by rounding. */
	double far = fmax(FAR * hypot(w->sd, w->setup->resolution_N / sqrt(12)),
			  1e-9 * fabs(w->slope) * w->range_mm);

	for (int k = 0; k < w->n_strokes; k++) {
		const struct stroke *s = &w->strokes[k];

		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED ||
			    w->states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER)
				w->states[i] = fabs(off_line(w, s, i)) > far
						       ? INCISE_CALIBRATE_STEPPER_OUTLIER
						       : INCISE_CALIBRATE_STEPPER_USED;
	}
}

static int least_squares(struct calibrate_stepper_work *w)
{
	double sxy = 0, squares = 0;
	int used = 0;

	w->sxx = 0;
	for (int k = 0; k < w->n_strokes; k++) {
		struct stroke *s = &w->strokes[k];
		double my = 0;

		s->used = 0;
		s->mean_mm = 0;
		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED) {
				s->used++;
				s->mean_mm +=
					(w->points[i].position_mm - s->mean_mm) / s->used;
				my += (w->points[i].force_N - my) / s->used;
			}
		if (s->used < 4)
			return -EDOM;
		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED) {
				double x = w->points[i].position_mm - s->mean_mm;

				w->sxx += x * x;
				sxy += x * (w->points[i].force_N - my);
			}
		s->zero_N = my;
		used += s->used;
	}
	if (!(w->sxx > 0))
		return -EDOM;
	w->slope = sxy / w->sxx;
	for (int k = 0; k < w->n_strokes; k++) {
		struct stroke *s = &w->strokes[k];

		s->zero_N -= w->slope * s->mean_mm;
		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED)
				squares += pow(off_line(w, s, i), 2);
	}
	w->sd = sqrt(squares / (used - w->n_strokes - 1));
	return 0;
}

/*
 * Fit lines of one slope through the points further than @skip_mm behind each turn, without
 * outliers. Returns 0, -EDOM (nothing to fit), -ENOMEM.
 */
static int fit_lines(struct calibrate_stepper_work *w, double skip_mm)
{
	double *scratch = malloc((w->n > PAIRS ? w->n : PAIRS) * sizeof(*scratch));
	int rc;

	if (!scratch)
		return -ENOMEM;
	choose_points(w, skip_mm);
	rc = slope_of_pairs(w, scratch);
	if (!rc)
		rc = medians(w, scratch);
	free(scratch);
	for (int round = 0; round < ROUNDS && !rc; round++) {
		drop_far(w);
		rc = least_squares(w);
	}
	return rc;
}

/*
 * --- refusals ---
 *
 * A sensor that does not move or does not follow, a reversed sign, lost steps, too small a range,
 * too many outliers: each is refused with a line of its own.
 */

#define BLOCKS 8  /* of the range, examined one by one */
#define SLIP 0.01 /* of full scale, that strokes of one way may be apart */

/* Noise is the distance of three points in a row from a line; the force has to exceed it. */
static int check_moves(const struct calibrate_stepper_work *w, struct incise_error *err)
{
	double *scratch = malloc(w->n * sizeof(*scratch)), noise, spread;
	int m = 0;

	if (!scratch)
		return incise_error_set(err, ENOMEM, "no memory for %d points", w->n);
	for (int i = 1; i + 1 < w->n; i++)
		scratch[m++] = fabs(w->points[i - 1].force_N - 2 * w->points[i].force_N +
				    w->points[i + 1].force_N) /
			       sqrt(6);
	noise = fmax(1.4826 * upper_median(scratch, m), w->setup->resolution_N);
	for (int i = 0; i < w->n; i++)
		scratch[i] = w->points[i].force_N;
	qsort(scratch, w->n, sizeof(*scratch), ascending);
	spread = scratch[w->n - 1 - w->n / 10] - scratch[w->n / 10];
	free(scratch);
	if (spread > 10 * noise)
		return 0;
	return incise_error_set(
		err, EDOM,
		"the force changes by %.3g N over %g mm, with a noise of %.2g N: the "
		"sensor does not react; check that the handle presses on it, and its "
		"cable",
		spread, w->range_mm, noise);
}

/* In each quarter, the median distance from the lines in its first half and its second. */
static int check_follows(const struct calibrate_stepper_work *w, struct incise_error *err)
{
	double *scratch = malloc(w->n * sizeof(*scratch)), low = INFINITY, middle[BLOCKS];
	bool known[BLOCKS] = {false};

	if (!scratch)
		return incise_error_set(err, ENOMEM, "no memory for %d points", w->n);
	for (int i = 0; i < w->n; i++)
		low = fmin(low, w->points[i].position_mm);
	for (int b = 0; b < BLOCKS; b++) {
		int m = 0;

		for (int k = 0; k < w->n_strokes; k++)
			for (int i = w->strokes[k].first; i <= w->strokes[k].last; i++) {
				double at =
					(w->points[i].position_mm - low) / w->range_mm;

				if (fmin(BLOCKS - 1, floor(at * BLOCKS)) == b &&
				    w->states[i] != INCISE_CALIBRATE_STEPPER_TURN)
					scratch[m++] = off_line(w, &w->strokes[k], i);
			}
		known[b] = m >= 4;
		if (known[b])
			middle[b] = upper_median(scratch, m);
	}
	free(scratch);
	for (int b = 0; b + 1 < BLOCKS; b++)
		if (known[b] && known[b + 1] &&
		    (middle[b + 1] - middle[b]) / (w->range_mm / BLOCKS) <
			    -0.5 * w->slope)
			return incise_error_set(
				err, EDOM,
				"from about %.3g to %.3g mm the force does not follow: "
				"the sensor is saturated or without contact; give "
				"another range",
				low + b * w->range_mm / BLOCKS,
				low + (b + 2) * w->range_mm / BLOCKS);
	return 0;
}

/* Strokes of one way lie on each other, unless steps were lost between them. */
static int check_slip(const struct calibrate_stepper_work *w,
		      struct incise_calibrate_stepper *result, struct incise_error *err)
{
	int least = w->n, from = 0;
	double worst = 0;

	for (int k = 0; k < w->n_strokes; k++) {
		if (w->strokes[k].used < least)
			least = w->strokes[k].used;
		for (int j = 0; j < k; j++) {
			double apart = fabs(w->strokes[k].zero_N - w->strokes[j].zero_N);

			if (w->strokes[k].way == w->strokes[j].way && apart > worst) {
				worst = apart;
				from = k;
			}
		}
	}
	result->drift_N = worst;
	if (worst <= SLIP * w->slope * w->range_mm + 6 * w->sd / sqrt(least))
		return 0;
	return incise_error_set(
		err, EDOM,
		"stroke %d differs by %.3g mm (%.3g N) from another in the same "
		"direction: steps were lost, or the zero of the force sensor drifts; "
		"go slower, or let it warm up",
		from + 1, worst / w->slope, worst);
}

/* Refuse lines that are not those of an actuator; count outliers. 0, -EDOM, -ENOMEM. */
static int check_lines(const struct calibrate_stepper_work *w,
		       struct incise_calibrate_stepper *result, struct incise_error *err)
{
	int rc;

	if (w->slope <= 0)
		return incise_error_set(
			err, EDOM,
			"the force falls by %.3g N per mm while the position rises: "
			"the sign of the sensor or of the actuator is reversed; see "
			"invert in rig.conf",
			-w->slope);
	rc = check_follows(w, err);
	if (!rc)
		rc = check_slip(w, result, err);
	if (rc)
		return rc;
	if (w->slope * w->range_mm < 30 * fmax(w->sd, w->setup->resolution_N))
		return incise_error_set(
			err, EDOM,
			"a range of %g mm, %.3g N, is too small for readings that "
			"deviate by %.2g N from a line; give a larger one",
			w->range_mm, w->slope * w->range_mm, w->sd);
	result->outliers = 0;
	for (int i = 0; i < w->n; i++)
		result->outliers += w->states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER;
	if (result->outliers > w->n / 7)
		return incise_error_set(
			err, EDOM,
			"%d of %d points are outliers; find the cause, for example "
			"vibration, and measure again",
			result->outliers, w->n);
	return 0;
}

/*
 * --- turns ---
 *
 * Behind a turn the force stands still, jumps, and its rest fades; all turns together show how
 * far. s is the way since the turn, and rho the force less its branch's line, on the side that
 * it came from:
 *
 *   rho   k(s - D) ____________ up to dead: the force stands still
 *                 /:stiction
 *                / o.
 *               /  rest `.
 *   ----------D----dead----`.------- s
 *
 * Four models are tried, the simple ones first: just the lines' distance D; a stiction; a rest;
 * both. One with more in it has to explain much more.
 */

#define LOOK 0.4 /* behind each turn, of the range */
/* Tried first, of that; then finer about the best. */
#define DEAD_GRAIN 0.025
#define FADE_GRAIN 1.5
#define ABOUT 1
#define MOMENTS 2000 /* at most */
/* Chi² that one more part of a model has to take away; noise rarely takes 12. */
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

/* Distance of the lines of two strokes that meet, in mm of lost travel. */
static double apart_mm(const struct calibrate_stepper_work *w, int k)
{
	return w->strokes[k].way * (w->strokes[k - 1].zero_N - w->strokes[k].zero_N) /
	       w->slope;
}

/* Points behind all turns but the first stroke's, whose turn was not measured. */
static int gather_calibrate_stepper(const struct calibrate_stepper_work *w, double far_mm,
				    struct moment *moments)
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
					gone, -s->way * off_line(w, s, i), D};
		}
	}
	qsort(moments, m, sizeof(*moments), by_way);
	/* More would add little, and the search passes over them a few thousand times. */
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
 * The model of a force that stands still up to @dead, with a rest that fades on @fade (0:
 * none). Without a @stiction the rest is what the dead travel leaves.
 */
static struct model try_model(const struct calibrate_stepper_work *w,
			      const struct moment *moments, int m, double D, double dead,
			      double fade, bool stiction)
{
	struct model model = {.dead_mm = dead, .fade_mm = fade};
	const double most_N = w->slope * (dead - D);
	const double by_mm = fade > 0 ? 1 / fade : 0;
	double sum_ff = 0, sum_rf = 0;

	for (int i = 0; i < m && fade > 0; i++) {
		/* A sensor that drifts moves the turns apart. */
		double behind = moments[i].s - dead - (moments[i].D - D);

		if (behind > 0 && behind < fade) {
			double f = 1 - behind * by_mm;

			sum_ff += f * f;
			sum_rf += f * moments[i].rho;
		}
	}
	model.sum = sum_ff;
	if (fade > 0 && stiction)
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

/* Try dead travels and fades about @from, so far apart, and keep the best. */
static void try_about(const struct calibrate_stepper_work *w,
		      const struct moment *moments, int m, double D, bool stiction,
		      double least_mm, struct model from, double wide, struct model *best)
{
	const double far_mm = LOOK * w->range_mm;

	for (int i = -ABOUT; i <= ABOUT; i++)
		for (int j = -ABOUT; j <= ABOUT; j++) {
			double dead = from.dead_mm + i * wide * DEAD_GRAIN * far_mm;
			double fade = from.fade_mm * pow(FADE_GRAIN, j * wide);
			struct model model;

			if (dead < 0 || dead + fade > far_mm ||
			    (stiction && dead < D && !fade))
				continue;
			if (!from.fade_mm && j)
				continue;
			/* A fade within a few points is a stiction; along the dead
			 * travel's own slope it is dead travel. */
			if (from.fade_mm > 0 &&
			    (fade < least_mm || fade < 2 * (D - dead)))
				continue;
			model = try_model(w, moments, m, D, dead, fade, stiction);
			if (model.chi2 < best->chi2)
				*best = model;
		}
}

static struct model search_calibrate_stepper(const struct calibrate_stepper_work *w,
					     const struct moment *moments, int m,
					     double D, double least_mm, bool stiction,
					     bool rest)
{
	const double far_mm = LOOK * w->range_mm;
	struct model best = {.chi2 = INFINITY};

	for (double dead = 0; dead < 0.7; dead += DEAD_GRAIN)
		for (double fade = 0.02; fade < 0.7; fade *= FADE_GRAIN) {
			struct model at = {.dead_mm = dead * far_mm,
					   .fade_mm = rest ? fade * far_mm : 0};

			try_about(w, moments, m, D, stiction, least_mm, at, 0, &best);
			if (!rest)
				break;
		}
	for (double wide = 0.5; wide > 0.02 && best.chi2 < INFINITY; wide *= 0.5)
		try_about(w, moments, m, D, stiction, least_mm, best, wide, &best);
	return best;
}

static int measure_turn(const struct calibrate_stepper_work *w,
			struct incise_calibrate_stepper *result)
{
	struct moment *moments = malloc(w->n * sizeof(*moments));
	double D[2] = {0, 0}, mean_mm, spacing, u_D2 = 0, u_rest, worth;
	int turns[2] = {0, 0}, m;
	struct model plain, stiction, rest, both, unseen, *best = &plain;

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
	m = gather_calibrate_stepper(w, LOOK * w->range_mm, moments);
	spacing = m > 1 ? (moments[m - 1].s - moments[0].s) * (w->n_strokes - 1) / m : 0;
	plain = try_model(w, moments, m, mean_mm, fmax(mean_mm, 0), 0, true);
	stiction = search_calibrate_stepper(w, moments, m, mean_mm, 0, true, false);
	rest = search_calibrate_stepper(w, moments, m, mean_mm, 4 * spacing, false, true);
	both = search_calibrate_stepper(w, moments, m, mean_mm, 4 * spacing, true, true);
	/* means of readings are no better than their last digit */
	worth = WORTH * (w->sd * w->sd + pow(w->setup->resolution_N, 2) / 12);
	if (stiction.chi2 < best->chi2 - worth)
		best = &stiction;
	if (rest.chi2 < (best == &plain ? plain.chi2 - worth : best->chi2 - worth / 2))
		best = &rest;
	if (both.chi2 < best->chi2 - worth)
		best = &both;
	result->branches_mm = mean_mm;
	result->dead_mm = best->dead_mm;
	result->rest_N = best->rest_N;
	result->rest_mm = best->fade_mm;
	result->stiction_N = 0;
	if (best == &stiction || best == &both)
		result->stiction_N =
			fmax(0, w->slope * (best->dead_mm - mean_mm) - best->rest_N);
	/* An unseen rest may still be there; twice: its fading is unknown. */
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

/* --- the whole --- */

#define LEAST_POINTS 8 /* of a stroke */
#define LEAST_STEPS 20 /* of the range */
#define FIRST_SKIP 0.3 /* of the range behind a turn, until the turn is known */
#define MOST_DEAD 0.25 /* of the range */
#define BLOCKS 8       /* of the range, for linearity */

void incise_calibrate_stepper_init(struct incise_calibrate_stepper_setup *setup)
{
	*setup = (struct incise_calibrate_stepper_setup){
		.step_mm = 0.000625,
		.sensor_u = 0.05 / sqrt(3),
		.low_N = NAN,
		.high_N = NAN,
		.spring_N_mm = NAN,
		.tolerance = 0.2,
		.linearity = 2,
	};
}

static int check_values(const struct incise_calibrate_stepper_point *points, int n,
			const struct incise_calibrate_stepper_setup *setup,
			struct incise_error *err)
{
	if (n < 1 || n > 1000000)
		return incise_error_set(err, EINVAL, "%d points: expected 1 to 1000000",
					n);
	if (!(setup->step_mm > 0 && setup->step_mm <= 100) ||
	    !(setup->sensor_u >= 0 && setup->sensor_u < 1) ||
	    !(setup->resolution_N >= 0 && setup->resolution_N < 1e4) ||
	    !(setup->tolerance > 0) || !(setup->linearity > 0) ||
	    (!isnan(setup->spring_N_mm) && !(setup->spring_N_mm > 0)))
		return incise_error_set(
			err, EINVAL,
			"step, uncertainty, resolution of the sensor or a limit is out "
			"of range; correct it");
	for (int i = 0; i < n; i++)
		if (!(fabs(points[i].position_mm) <= 1e4) ||
		    !(fabs(points[i].force_N) <= 1e4))
			return incise_error_set(
				err, EINVAL,
				"point %d: position_mm and force_N: expected numbers "
				"up to 10000; correct it",
				i + 1);
	return 0;
}

static int find_strokes(struct calibrate_stepper_work *w, struct incise_error *err)
{
	int ways[2] = {0, 0}, most = w->n / 4 + 1, short_ones = 0;
	struct stroke *s = NULL;
	double low = INFINITY, high = -INFINITY;

	for (int i = 0; i < w->n; i++) {
		double mm = w->points[i].position_mm;
		double went = i ? mm - w->points[i - 1].position_mm : 0;
		int way = (went > 0) - (went < 0);

		low = fmin(low, mm);
		high = fmax(high, mm);
		if (!s || (way && s->way && way != s->way)) {
			if (w->n_strokes == most)
				return incise_error_set(
					err, EDOM,
					"positions reverse every few points and form "
					"no strokes; check that the columns are not "
					"swapped");
			s = &w->strokes[w->n_strokes++];
			*s = (struct stroke){.first = i,
					     .from_mm = i ? w->points[i - 1].position_mm
							  : mm};
		}
		s->last = i;
		if (way)
			s->way = way;
	}
	w->range_mm = high - low;
	if (w->range_mm < LEAST_STEPS * w->setup->step_mm)
		return incise_error_set(
			err, EDOM,
			"a range of %g mm is too small: %d steps are %g mm; give a larger one",
			w->range_mm, LEAST_STEPS, LEAST_STEPS * w->setup->step_mm);
	/* Leave out the ways to the first stroke and home after the last. */
	while (w->n_strokes && w->strokes->last - w->strokes->first + 1 < LEAST_POINTS) {
		w->n_strokes--;
		for (int k = 0; k < w->n_strokes; k++)
			w->strokes[k] = w->strokes[k + 1];
	}
	while (w->n_strokes && w->strokes[w->n_strokes - 1].last -
					       w->strokes[w->n_strokes - 1].first + 1 <
				       LEAST_POINTS)
		w->n_strokes--;
	for (int k = 0; k < w->n_strokes; k++) {
		ways[w->strokes[k].way > 0]++;
		short_ones += w->strokes[k].last - w->strokes[k].first + 1 < LEAST_POINTS;
	}
	if (short_ones > w->n_strokes / 3)
		return incise_error_set(
			err, EDOM,
			"%d of %d strokes have fewer than %d points; check that the "
			"columns are not swapped",
			short_ones, w->n_strokes, LEAST_POINTS);
	if (short_ones || ways[0] < 2 || ways[1] < 2)
		return incise_error_set(
			err, ENODATA,
			"%d strokes up and %d down, %d of them with fewer than %d "
			"points; give two in each direction, and more points",
			ways[1], ways[0], short_ones, LEAST_POINTS);
	return 0;
}

static int find_saturated(struct calibrate_stepper_work *w,
			  struct incise_calibrate_stepper *result,
			  struct incise_error *err)
{
	const struct incise_calibrate_stepper_setup *s = w->setup;
	const double margin = 1.5 * s->resolution_N;
	double at = 0;

	for (int i = 0; i < w->n; i++) {
		double F = w->points[i].force_N;

		if (!(F >= s->high_N - margin) && !(F <= s->low_N + margin))
			continue;
		w->states[i] = INCISE_CALIBRATE_STEPPER_SATURATED;
		at = w->points[i].position_mm;
		result->saturated++;
	}
	if (result->saturated > w->n / 10)
		return incise_error_set(
			err, EDOM,
			"the force sensor is saturated at %d of %d points, for example "
			"at %g mm; give a smaller range",
			result->saturated, w->n, at);
	return 0;
}

/* Means of an eighth of the range: of each stroke, for misfit, and of all, for linearity. */
static void measure_bends(const struct calibrate_stepper_work *w,
			  struct incise_calibrate_stepper *result)
{
	double all[2][BLOCKS] = {{0}}, chi2 = 0;
	int counts[2][BLOCKS] = {{0}}, blocks = 0;

	for (int k = 0; k < w->n_strokes; k++) {
		const struct stroke *s = &w->strokes[k];
		double sum[BLOCKS] = {0};
		int n[BLOCKS] = {0};

		for (int i = s->first; i <= s->last; i++) {
			double at = (w->points[i].position_mm - result->low_mm) /
				    (result->high_mm - result->low_mm);
			int b = (int)fmax(0, fmin(BLOCKS - 1, at * BLOCKS));
			double off;

			if (w->states[i] != INCISE_CALIBRATE_STEPPER_USED)
				continue;
			off = off_line(w, s, i);
			sum[b] += off;
			n[b]++;
			all[s->way > 0][b] += off;
			counts[s->way > 0][b]++;
		}
		for (int b = 0; b < BLOCKS; b++)
			if (n[b]) {
				chi2 += sum[b] * sum[b] / n[b] / (w->sd * w->sd + 1e-24);
				blocks++;
			}
	}
	blocks -= w->n_strokes + 1;
	result->misfit = 1;
	if (blocks > 0 && chi2 > chi2_99(blocks))
		result->misfit = sqrt(chi2 / blocks);
	for (int way = 0; way < 2; way++)
		for (int b = 0; b < BLOCKS; b++)
			if (counts[way][b] >= 2)
				result->linearity =
					fmax(result->linearity,
					     fabs(all[way][b] / counts[way][b]));
	result->linearity *= 100 / (w->slope * (result->high_mm - result->low_mm));
}

static void add_calibrate_stepper_part(struct incise_calibrate_stepper *result,
				       const char *source, char type, double u,
				       const char *unit, double u_N_step)
{
	result->budget.part[result->budget.n++] = (struct incise_calibration_part){
		source, type, u, unit, u > 0 ? u_N_step / u : 0, u_N_step};
	result->N_step_u = hypot(result->N_step_u, u_N_step);
}

static void measure_range(const struct calibrate_stepper_work *w,
			  struct incise_calibrate_stepper *result)
{
	result->low_mm = result->low_N = INFINITY;
	result->high_mm = result->high_N = -INFINITY;
	for (int i = 0; i < w->n; i++) {
		if (w->states[i] != INCISE_CALIBRATE_STEPPER_USED)
			continue;
		result->used++;
		result->low_mm = fmin(result->low_mm, w->points[i].position_mm);
		result->high_mm = fmax(result->high_mm, w->points[i].position_mm);
		result->low_N = fmin(result->low_N, w->points[i].force_N);
		result->high_N = fmax(result->high_N, w->points[i].force_N);
	}
}

static void conclude(const struct calibrate_stepper_work *w,
		     struct incise_calibrate_stepper *result)
{
	const struct incise_calibrate_stepper_setup *s = w->setup;
	const double step = s->step_mm, root = sqrt(w->sxx);
	int ways[2] = {0, 0};
	double line_u;

	measure_range(w, result);
	measure_bends(w, result);
	result->strokes = w->n_strokes;
	result->freedom = result->used - w->n_strokes - 1;
	result->residual_sd_N = w->sd;
	result->N_mm = w->slope;
	result->N_step = w->slope * step;
	line_u = w->sd * result->misfit / root;
	add_calibrate_stepper_part(result, "scatter of readings", 'A',
				   w->sd * result->misfit, "N", line_u * step);
	/* Noise of half a code and more makes means finer than a code. */
	if (s->resolution_N > 0 && w->sd < s->resolution_N / 2)
		add_calibrate_stepper_part(result, "resolution of the sensor", 'B',
					   s->resolution_N / sqrt(12), "N",
					   s->resolution_N / sqrt(12) / root * step);
	add_calibrate_stepper_part(result, "sensitivity of the sensor", 'B',
				   100 * s->sensor_u, "%", result->N_step * s->sensor_u);
	result->N_mm_u = result->N_step_u / step;
	for (int k = 0; k < w->n_strokes; k++) {
		double *zero = w->strokes[k].way > 0 ? &result->up_N : &result->down_N;

		*zero += (w->strokes[k].zero_N - *zero) / ++ways[w->strokes[k].way > 0];
	}
	result->pass = result->linearity <= s->linearity &&
		       !(fabs(result->N_mm / s->spring_N_mm - 1) > s->tolerance);
}

static int fit(struct calibrate_stepper_work *w, struct incise_calibrate_stepper *result,
	       struct incise_error *err)
{
	double skip_mm = FIRST_SKIP * w->range_mm;

	/* First skip a large part of each stroke, then just the turns. */
	for (int round = 0; round < 2; round++) {
		int rc = fit_lines(w, skip_mm);

		if (rc == -ENOMEM)
			return incise_error_set(err, ENOMEM, "no memory for %d points",
						w->n);
		if (rc)
			return incise_error_set(
				err, ENODATA,
				"too few points lie on the lines of the strokes; give "
				"strokes over the whole range, with more points");
		rc = check_lines(w, result, err);
		if (!rc && measure_turn(w, result))
			rc = incise_error_set(err, ENOMEM, "no memory for %d points",
					      w->n);
		if (rc)
			return rc;
		if (result->dead_mm > MOST_DEAD * w->range_mm)
			return incise_error_set(
				err, EDOM,
				"after a reversal the force does not change for %.3g "
				"mm, and the range is %g mm; give a larger one",
				result->dead_mm, w->range_mm);
		skip_mm = fmin(FIRST_SKIP * w->range_mm,
			       1.1 * (result->dead_mm + result->rest_mm) +
				       0.02 * w->range_mm);
	}
	return 0;
}

int incise_calibrate_stepper(const struct incise_calibrate_stepper_point *points, int n,
			     const struct incise_calibrate_stepper_setup *setup,
			     struct incise_calibrate_stepper *result,
			     enum incise_calibrate_stepper_state *states,
			     struct incise_error *err)
{
	struct calibrate_stepper_work w = {.points = points, .setup = setup, .n = n};
	int rc = check_values(points, n, setup, err);

	*result = (struct incise_calibrate_stepper){.points = n};
	if (rc)
		return rc;
	w.strokes = calloc(n / 4 + 1, sizeof(*w.strokes));
	w.states = calloc(n, sizeof(*w.states));
	if (!w.strokes || !w.states)
		rc = incise_error_set(err, ENOMEM, "no memory for %d points", n);
	if (!rc)
		rc = find_strokes(&w, err);
	if (!rc)
		rc = find_saturated(&w, result, err);
	if (!rc)
		rc = check_moves(&w, err);
	if (!rc)
		rc = fit(&w, result, err);
	if (!rc)
		conclude(&w, result);
	for (int i = 0; i < n && states && w.states; i++)
		states[i] = w.states[i];
	free(w.states);
	free(w.strokes);
	return rc;
}
