// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A delay roughly: the peak of the correlation, and where the contact begins; see delay.h.
 *
 * A part of one noun: tests/unit/calib/delay.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "delay.h"

#define COARSE_KNOTS 5
#define COARSE_STRIDE 2 /* rows; neighbours are alike through the filter */
#define COARSE_LAG 2
#define CONTACTS 24
#define NEAR_LAGS 5

/* What grows with speed, whichever way, does so by then. */
#define SLOW_MM_S 10.0
#define FAST_MM_S 50.0

static void filter_column(struct delay_grid *grid, int k)
{
	delay_grid_filter(grid, grid->scratch, grid->column[k]);
}

void delay_columns(struct delay *d, double contact_mm)
{
	struct delay_grid *grid = &d->grid;
	double scale = d->high_mm - d->low_mm;

	grid->columns = d->relation == INCISE_DELAY_FORCE ? DELAY_COLUMNS : 1;
	for (int k = 0; k < grid->columns; k++) {
		for (int i = 0; i < grid->n; i++) {
			double x = fmax(0, grid->motion[i] - contact_mm) / scale;
			double v = grid->speed[i] / scale;
			double slow =
				fabs(grid->speed[i]) / (fabs(grid->speed[i]) + SLOW_MM_S);
			double fast =
				fabs(grid->speed[i]) / (fabs(grid->speed[i]) + FAST_MM_S);
			const double all[DELAY_COLUMNS] = {
				x,
				x * x,
				x * x * x,
				v * x,
				v * x * x,
				slow * x,
				slow * x * x,
				fast * x,
				fast * x * x,
			};

			grid->scratch[i] = all[k];
		}
		filter_column(grid, k);
	}
}

/* Straight pieces that can bend into any curve: good enough for the search. */
static void make_coarse_columns(struct delay *d)
{
	struct delay_grid *grid = &d->grid;

	grid->columns = d->relation == INCISE_DELAY_FORCE ? COARSE_KNOTS : 1;
	for (int k = 0; k < grid->columns; k++) {
		double knot = k ? d->low_mm + k * (d->high_mm - d->low_mm) / COARSE_KNOTS
				: d->floor_mm;

		for (int i = 0; i < grid->n; i++)
			grid->scratch[i] = fmax(0, grid->motion[i] - knot);
		filter_column(grid, k);
	}
}

/* Rows that can be compared at any delay within the range. */
bool delay_usable(const struct delay *d, int i, int shift)
{
	const struct delay_grid *grid = &d->grid;
	int from = i + shift - 2, to = i + shift + 3;

	return grid->good[i] && from >= 0 && to < grid->n && grid->good[from] &&
	       grid->good[to];
}

static void coarse_normal(const struct delay *d, int shift, struct delay_normal *normal)
{
	const struct delay_grid *grid = &d->grid;
	double row[DELAY_UNKNOWNS];

	memset(normal, 0, sizeof(*normal));
	normal->m = grid->columns;
	for (int i = 0; i < grid->n; i += COARSE_STRIDE) {
		if (!delay_usable(d, i, shift))
			continue;
		for (int k = 0; k < grid->columns; k++)
			row[k] = grid->column[k][i + shift];
		delay_add_row(normal, row, grid->target[i]);
	}
}

/* Correlation of the target and what the columns make of it; negative for a mirror image. */
static double correlation(const struct delay_normal *normal)
{
	double x[DELAY_UNKNOWNS], explained = 0, slope = 0;
	int m = normal->m;

	if (!(normal->yy > 0) || !delay_solve(normal, x))
		return 0;
	for (int k = 0; k < m; k++) {
		explained += x[k] * normal->b[k];
		/* with the first column, which is the motion itself */
		slope += x[k] * normal->a[k * m];
	}
	explained = sqrt(fmax(0, fmin(1, explained / normal->yy)));
	return slope < 0 ? -explained : explained;
}

int delay_search(struct delay *d, struct incise_delay_fit *fit, struct incise_error *err)
{
	int lags = 2 * (d->range / COARSE_LAG) + 1, best = 0;
	double *r = calloc((size_t)lags, sizeof(*r));
	double second = 0, peak;

	if (!r)
		return incise_error_set(err, ENOMEM, "out of memory");
	make_coarse_columns(d);
	for (int l = 0; l < lags; l++) {
		struct delay_normal normal;

		coarse_normal(d, (l - lags / 2) * COARSE_LAG, &normal);
		r[l] = correlation(&normal);
		if (r[l] > r[best])
			best = l;
	}
	peak = r[best];
	for (int l = 1; l < lags - 1; l++)
		if (l != best && r[l] >= r[l - 1] && r[l] >= r[l + 1])
			second = fmax(second, r[l]);
	/* one that goes on rising at the end may be anything beyond */
	if (lags > 1 && best != 0 && r[0] > r[1])
		second = fmax(second, r[0]);
	if (lags > 1 && best != lags - 1 && r[lags - 1] > r[lags - 2])
		second = fmax(second, r[lags - 1]);
	free(r);
	d->shift = (best - lags / 2) * COARSE_LAG;
	fit->delay_ms = d->shift * DELAY_STEP_S * 1e3;
	fit->correlation = peak;
	fit->second = peak > 0 ? second / peak : 1;
	if (peak < INCISE_DELAY_CORRELATION_MIN)
		return incise_error_set(
			err, EDOM,
			"the streams are too little alike (correlation %.2f, %g is needed); "
			"tap on, or press, something springy, quickly and unevenly",
			peak, INCISE_DELAY_CORRELATION_MIN);
	if (fit->second > INCISE_DELAY_SECOND_MAX)
		return incise_error_set(err, EDOM,
					"the motion is periodic: another delay fits "
					"%.0f %% as well; tap unevenly",
					100 * fit->second);
	if (best == 0 || best == lags - 1)
		return incise_error_set(err, EDOM,
					"the delay is beyond %.0f ms; look farther",
					d->range * DELAY_STEP_S * 1e3);
	return 0;
}

/* What is left unexplained with the present columns; HUGE_VAL where nothing can be said. */
static double coarse_rest(const struct delay *d, int shift)
{
	struct delay_normal normal;
	double x[DELAY_UNKNOWNS], rest;

	coarse_normal(d, shift, &normal);
	if (!(normal.yy > 0) || !delay_solve(&normal, x))
		return HUGE_VAL;
	rest = normal.yy;
	for (int k = 0; k < normal.m; k++)
		rest -= x[k] * normal.b[k];
	return rest / normal.yy;
}

void delay_search_contact(struct delay *d)
{
	double least = HUGE_VAL;
	int middle = (int)d->shift;

	d->contact_mm = d->floor_mm;
	for (int at = 0; at < CONTACTS; at++) {
		double contact = at ? d->low_mm + (at - 0.5) * 0.8 *
							  (d->high_mm - d->low_mm) /
							  CONTACTS
				    : d->floor_mm;

		delay_columns(d, contact);
		for (int lag = -NEAR_LAGS; lag <= NEAR_LAGS; lag++) {
			double rest = abs(middle + lag) > d->range
					      ? HUGE_VAL
					      : coarse_rest(d, middle + lag);

			if (rest >= least)
				continue;
			least = rest;
			d->shift = middle + lag;
			d->contact_mm = contact;
			d->touches = at > 0;
		}
	}
	if (d->relation == INCISE_DELAY_ALIKE)
		d->touches = d->contact_mm > d->low_mm;
}
