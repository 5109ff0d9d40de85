// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The calibration of an actuator against a force sensor; see incise/calibrate_stepper.h. Here:
 * strokes, the order of things, and what is concluded. Lines are stepper_lines.c, turns
 * stepper_turn.c, and what is refused of both stepper_check.c.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "stepper_work.h"

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
		return incise_error_set(err, EINVAL,
					"%d points; give 1 to 1000000 of them", n);
	if (!(setup->step_mm > 0 && setup->step_mm <= 100) ||
	    !(setup->sensor_u >= 0 && setup->sensor_u < 1) ||
	    !(setup->resolution_N >= 0 && setup->resolution_N < 1e4) ||
	    !(setup->tolerance > 0) || !(setup->linearity > 0) ||
	    (!isnan(setup->spring_N_mm) && !(setup->spring_N_mm > 0)))
		return incise_error_set(
			err, EINVAL,
			"step, uncertainty or resolution of the sensor, or what "
			"passes, is out of range; correct it");
	for (int i = 0; i < n; i++)
		if (!(fabs(points[i].position_mm) <= 1e4) ||
		    !(fabs(points[i].force_N) <= 1e4))
			return incise_error_set(
				err, EINVAL,
				"point %d: position_mm and force_N are to be numbers up "
				"to 10000; correct it",
				i + 1);
	return 0;
}

static int find_strokes(struct stepper_work *w, struct incise_error *err)
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
					"positions turn round at every few points and are no "
					"strokes; are the columns swapped?");
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
	/* On its way to the first stroke, and home after the last. */
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
			"%d of %d strokes are shorter than %d points; are the "
			"columns swapped?",
			short_ones, w->n_strokes, LEAST_POINTS);
	if (short_ones || ways[0] < 2 || ways[1] < 2)
		return incise_error_set(
			err, ENODATA,
			"%d strokes up and %d down, %d of them with fewer than %d points; "
			"give two of each way, and more points",
			ways[1], ways[0], short_ones, LEAST_POINTS);
	return 0;
}

static int find_saturated(struct stepper_work *w, struct incise_calibrate_stepper *result,
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
			"the force sensor is saturated at %d of %d points, such "
			"as at %g mm; give a smaller range",
			result->saturated, w->n, at);
	return 0;
}

/* What chi² exceeds in 1 of 100, by Wilson and Hilferty. */
static double chi2_99(int freedom)
{
	double h = 2.0 / (9 * freedom);

	return freedom * pow(1 - h + 2.326348 * sqrt(h), 3);
}

/* Means of an eighth of the range: of each stroke, for misfit, and of all, for linearity. */
static void measure_bends(const struct stepper_work *w,
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
			off = incise_stepper_off(w, s, i);
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

static void add_part(struct incise_calibrate_stepper *result, const char *source,
		     char type, double u, const char *unit, double u_N_step)
{
	struct incise_calibrate_stepper_part *part = &result->part[result->parts++];

	snprintf(part->source, sizeof(part->source), "%s", source);
	snprintf(part->unit, sizeof(part->unit), "%s", unit);
	part->type = type;
	part->u = u;
	part->u_N_step = u_N_step;
	result->N_step_u = hypot(result->N_step_u, u_N_step);
}

static void measure_range(const struct stepper_work *w,
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

static void conclude(const struct stepper_work *w,
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
	add_part(result, "scatter of readings", 'A', w->sd * result->misfit, "N",
		 line_u * step);
	/* Noise of half a code and more makes means finer than a code. */
	if (s->resolution_N > 0 && w->sd < s->resolution_N / 2)
		add_part(result, "resolution of the sensor", 'B',
			 s->resolution_N / sqrt(12), "N",
			 s->resolution_N / sqrt(12) / root * step);
	add_part(result, "sensitivity of the sensor", 'B', 100 * s->sensor_u, "%",
		 result->N_step * s->sensor_u);
	result->N_mm_u = result->N_step_u / step;
	for (int k = 0; k < w->n_strokes; k++) {
		double *zero = w->strokes[k].way > 0 ? &result->up_N : &result->down_N;

		*zero += (w->strokes[k].zero_N - *zero) / ++ways[w->strokes[k].way > 0];
	}
	result->pass = result->linearity <= s->linearity &&
		       !(fabs(result->N_mm / s->spring_N_mm - 1) > s->tolerance);
}

static int fit(struct stepper_work *w, struct incise_calibrate_stepper *result,
	       struct incise_error *err)
{
	double skip_mm = FIRST_SKIP * w->range_mm;

	/* Behind a part of each stroke that is large enough first, then behind the turns. */
	for (int round = 0; round < 2; round++) {
		int rc = incise_stepper_lines(w, skip_mm);

		if (rc == -ENOMEM)
			return incise_error_set(err, ENOMEM, "no memory for %d points",
						w->n);
		if (rc)
			return incise_error_set(
				err, ENODATA,
				"too few points lie on the strokes' lines; strokes are to go "
				"through the whole range, with more points");
		rc = incise_stepper_check_lines(w, result, err);
		if (!rc && incise_stepper_turn(w, result))
			rc = incise_error_set(err, ENOMEM, "no memory for %d points",
					      w->n);
		if (rc)
			return rc;
		if (result->dead_mm > MOST_DEAD * w->range_mm)
			return incise_error_set(
				err, EDOM,
				"after turning round the force stands still for %.3g mm, and "
				"the range is %g mm; give a larger one",
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
	struct stepper_work w = {.points = points, .setup = setup, .n = n};
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
		rc = incise_stepper_check_moves(&w, err);
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
