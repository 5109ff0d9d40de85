// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is told of a force channel beside its line, in the words of ISO 376: linearity,
 * hysteresis, repeatability, zero return. In percent of full scale, the reading of the largest
 * load above the zero.
 *
 * A part of one noun: tests/unit/calib/force.c tests it through its door.
 */
#include <math.h>
#include "force_work.h"

/* Readings of one load that one way leads to. */
struct way {
	double sum, least, most;
	int n;
};

static void take(struct way *way, double reading)
{
	if (!way->n || reading < way->least)
		way->least = reading;
	if (!way->n || reading > way->most)
		way->most = reading;
	way->sum += reading;
	way->n++;
}

/* Both ways of a load; series of readings of the first are counted as they differ. */
static void gather(const struct work *w, int load, struct way *up, struct way *down)
{
	*up = *down = (struct way){0};
	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] == load)
			take(w->pairs[i].descending ? down : up, w->y[i]);
}

static bool is_first_of_series(const struct work *w, int i)
{
	for (int j = 0; j < i; j++)
		if (w->pairs[j].series == w->pairs[i].series)
			return false;
	return true;
}

/* Zero behind the loads of a series against that before them; NAN: not both are there. */
static double zero_return_mV(const struct work *w, int series)
{
	double before = NAN, after = NAN;
	bool loaded = false;

	for (int i = 0; i < w->n; i++) {
		if (w->pairs[i].series != series || w->load_of[i] < 0)
			continue;
		if (w->F[i] > 0)
			loaded = true;
		else if (!loaded && isnan(before))
			before = w->y[i];
		else if (loaded)
			after = w->y[i];
	}
	return fabs(after - before);
}

/* fmax() takes the number where one of two is NaN: figures begin as not stated. */
void incise_calibrate_force_figures(const struct work *w,
				    struct incise_calibrate_force *result)
{
	const struct load *last = &w->loads[w->n_loads - 1];
	const double S = result->sensitivity_mV_N;
	const double percent = 100 / (S * last->F_N);

	result->hysteresis = result->repeatability = result->zero_return = NAN;
	for (int k = 0; k < w->n_loads; k++) {
		const struct load *load = &w->loads[k];
		struct way up, down;

		result->linearity = fmax(
			result->linearity,
			percent * fabs(load->mean_mV - result->zero_mV - S * load->F_N));
		gather(w, k, &up, &down);
		if (up.n && down.n)
			result->hysteresis =
				fmax(result->hysteresis,
				     percent * fabs(up.sum / up.n - down.sum / down.n));
		if (up.n > 1)
			result->repeatability = fmax(result->repeatability,
						     percent * (up.most - up.least));
	}
	for (int i = 0; i < w->n; i++)
		if (is_first_of_series(w, i)) {
			result->series++;
			result->zero_return =
				fmax(result->zero_return,
				     percent * zero_return_mV(w, w->pairs[i].series));
		}
	if (result->series < 2)
		result->repeatability = NAN;
	result->resolution_N = w->setup->step_mV > 0 ? w->setup->step_mV / S : NAN;
	result->low_N = w->loads[0].F_N;
	result->high_N = last->F_N;
	result->clips_N = (w->setup->high_mV - result->zero_mV) / S;
}
