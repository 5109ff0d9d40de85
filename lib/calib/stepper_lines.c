// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lines of one slope, one for each stroke of an actuator, beside outliers: the median of the
 * slopes of pairs within strokes (P. K. Sen, J. Am. Stat. Assoc. 63, 1968), then least squares
 * of what lies near it. A zero for each stroke takes up a sensor that drifts.
 */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include "../base/ascending.h"
#include "stepper_work.h"

#define PAIRS 4000
#define ROUNDS 10
/* A good reading in 150000 lies as far off as this many sd. */
#define FAR 4.5

double incise_stepper_off(const struct stepper_work *w, const struct stroke *stroke,
			  int i)
{
	return w->points[i].force_N - stroke->zero_N -
	       w->slope * w->points[i].position_mm;
}

/* Knuth's MMIX; the high bits are the good ones. */
static uint32_t choose(uint64_t *choice, uint32_t n)
{
	*choice = *choice * 6364136223846793005u + 1442695040888963407u;
	return (uint32_t)(*choice >> 33) % n;
}

/* Points behind the turns and not saturated are to be used, until they prove to be far. */
static void choose_points(struct stepper_work *w, double skip_mm)
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
static int slope_of_pairs(struct stepper_work *w, double *room)
{
	uint64_t choice = 1;
	int n = 0;

	for (int tries = 0; tries < 4 * PAIRS && n < PAIRS; tries++) {
		const struct stroke *s = &w->strokes[choose(&choice, w->n_strokes)];
		int length = s->last - s->first + 1;
		int i = s->first + (int)choose(&choice, length);
		int j = s->first + (int)choose(&choice, length);
		double mm = w->points[j].position_mm - w->points[i].position_mm;

		if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED &&
		    w->states[j] == INCISE_CALIBRATE_STEPPER_USED &&
		    fabs(mm) > 0.2 * w->range_mm)
			room[n++] = (w->points[j].force_N - w->points[i].force_N) / mm;
	}
	if (n < 10)
		return -EDOM;
	qsort(room, n, sizeof(*room), ascending);
	w->slope = room[n / 2];
	return 0;
}

/* The zero of each stroke, and the spread about the lines, by medians. */
static int medians(struct stepper_work *w, double *room)
{
	int all = 0;

	for (int k = 0; k < w->n_strokes; k++) {
		struct stroke *s = &w->strokes[k];
		int n = 0;

		s->zero_N = 0;
		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED)
				room[n++] = incise_stepper_off(w, s, i);
		if (n < 4)
			return -EDOM;
		qsort(room, n, sizeof(*room), ascending);
		s->zero_N = n % 2 ? room[n / 2] : (room[n / 2 - 1] + room[n / 2]) / 2;
	}
	for (int k = 0; k < w->n_strokes; k++)
		for (int i = w->strokes[k].first; i <= w->strokes[k].last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED)
				room[all++] =
					fabs(incise_stepper_off(w, &w->strokes[k], i));
	qsort(room, all, sizeof(*room), ascending);
	w->sd = 1.4826 * room[all / 2];
	return 0;
}

static void drop_far(struct stepper_work *w)
{
	/* Readings without any noise scatter by rounding. */
	double far = fmax(FAR * hypot(w->sd, w->setup->resolution_N / sqrt(12)),
			  1e-9 * fabs(w->slope) * w->range_mm);

	for (int k = 0; k < w->n_strokes; k++) {
		const struct stroke *s = &w->strokes[k];

		for (int i = s->first; i <= s->last; i++)
			if (w->states[i] == INCISE_CALIBRATE_STEPPER_USED ||
			    w->states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER)
				w->states[i] = fabs(incise_stepper_off(w, s, i)) > far
						       ? INCISE_CALIBRATE_STEPPER_OUTLIER
						       : INCISE_CALIBRATE_STEPPER_USED;
	}
}

static int least_squares(struct stepper_work *w)
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
				squares += pow(incise_stepper_off(w, s, i), 2);
	}
	w->sd = sqrt(squares / (used - w->n_strokes - 1));
	return 0;
}

int incise_stepper_lines(struct stepper_work *w, double skip_mm)
{
	double *room = malloc((w->n > PAIRS ? w->n : PAIRS) * sizeof(*room));
	int rc;

	if (!room)
		return -ENOMEM;
	choose_points(w, skip_mm);
	rc = slope_of_pairs(w, room);
	if (!rc)
		rc = medians(w, room);
	free(room);
	for (int round = 0; round < ROUNDS && !rc; round++) {
		drop_far(w);
		rc = least_squares(w);
	}
	return rc;
}
