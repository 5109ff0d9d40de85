// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What the calibration of an actuator refuses, each by its own line: a sensor that does not
 * move or does not follow, a reversed sign, lost steps, too small a range, too many outliers.
 *
 * A part of one noun: tests/unit/calib/stepper.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/ascending.h"
#include "stepper_work.h"

#define BLOCKS 8  /* of the range, that are looked at one by one */
#define SLIP 0.01 /* of full scale, that strokes of one way may be apart */

/* Noise is what three points in a row are off a line; the force has to go much further. */
int incise_stepper_check_moves(const struct stepper_work *w, struct incise_error *err)
{
	double *room = malloc(w->n * sizeof(*room)), noise, spread;
	int m = 0;

	if (!room)
		return incise_error_set(err, ENOMEM, "no memory for %d points", w->n);
	for (int i = 1; i + 1 < w->n; i++)
		room[m++] = fabs(w->points[i - 1].force_N - 2 * w->points[i].force_N +
				 w->points[i + 1].force_N) /
			    sqrt(6);
	qsort(room, m, sizeof(*room), ascending);
	noise = fmax(1.4826 * room[m / 2], w->setup->resolution_N);
	for (int i = 0; i < w->n; i++)
		room[i] = w->points[i].force_N;
	qsort(room, w->n, sizeof(*room), ascending);
	spread = room[w->n - 1 - w->n / 10] - room[w->n / 10];
	free(room);
	if (spread > 10 * noise)
		return 0;
	return incise_error_set(
		err, EDOM,
		"the force changes by %.3g N over %g mm, and its noise is %.2g N: the sensor "
		"does not move; does the handle press it, is its cable in?",
		spread, w->range_mm, noise);
}

static double median(double *values, int n)
{
	qsort(values, n, sizeof(*values), ascending);
	return values[n / 2];
}

/* In each quarter, the median distance from the lines in its first half and its second. */
static int check_follows(const struct stepper_work *w, struct incise_error *err)
{
	double *room = malloc(w->n * sizeof(*room)), low = INFINITY, middle[BLOCKS];
	bool known[BLOCKS] = {false};

	if (!room)
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
					room[m++] =
						incise_stepper_off(w, &w->strokes[k], i);
			}
		known[b] = m >= 4;
		if (known[b])
			middle[b] = median(room, m);
	}
	free(room);
	for (int b = 0; b + 1 < BLOCKS; b++)
		if (known[b] && known[b + 1] &&
		    (middle[b + 1] - middle[b]) / (w->range_mm / BLOCKS) <
			    -0.5 * w->slope)
			return incise_error_set(
				err, EDOM,
				"from about %.3g to %.3g mm the force does not follow: the "
				"sensor is saturated there, or not in touch; give a range "
				"where it is",
				low + b * w->range_mm / BLOCKS,
				low + (b + 2) * w->range_mm / BLOCKS);
	return 0;
}

/* Strokes of one way lie on each other, unless steps were lost between them. */
static int check_slip(const struct stepper_work *w,
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
		"stroke %d lies %.3g mm (%.3g N) beside another of its way: steps were lost, or "
		"the force sensor's zero drifts; go slower, or let it warm up",
		from + 1, worst / w->slope, worst);
}

int incise_stepper_check_lines(const struct stepper_work *w,
			       struct incise_calibrate_stepper *result,
			       struct incise_error *err)
{
	int rc;

	if (w->slope <= 0)
		return incise_error_set(
			err, EDOM,
			"the force falls by %.3g N per mm where the position rises: the sign of "
			"the sensor or of the actuator is reversed; see invert in rig.conf",
			-w->slope);
	rc = check_follows(w, err);
	if (!rc)
		rc = check_slip(w, result, err);
	if (rc)
		return rc;
	if (w->slope * w->range_mm < 30 * fmax(w->sd, w->setup->resolution_N))
		return incise_error_set(
			err, EDOM,
			"a range of %g mm, %.3g N, is too small for readings that lie %.2g N "
			"off a line; give a larger one",
			w->range_mm, w->slope * w->range_mm, w->sd);
	result->outliers = 0;
	for (int i = 0; i < w->n; i++)
		result->outliers += w->states[i] == INCISE_CALIBRATE_STEPPER_OUTLIER;
	if (result->outliers > w->n / 7)
		return incise_error_set(
			err, EDOM,
			"%d of %d points lie far off any line; see what shakes "
			"the sensor, and measure again",
			result->outliers, w->n);
	return 0;
}
