// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Delay between two streams of one motion; see incise/calibrate_delay.h. Within, delays are
 * in steps of the grid.
 *
 *     target(i) ≈ Σ c_k · column_k(i + delay)       columns depend on where contact begins
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "delay.h"

#define MOTION_MIN_MM 1.0
#define ITERATIONS 12
#define BEYOND 2 /* steps that a fit may leave the range by */

/* --- the fit --------------------------------------------------------------------------- */

/* Sum of squares of the rest; the coefficients are the best for delay and contact as they
 * are. Negative: there are none. */
static double make_tangent(struct delay *d, struct delay_tangent *t)
{
	struct delay_grid *grid = &d->grid;
	double h = 0.02 * (d->high_mm - d->low_mm), squares = 0;
	int k_delay, whole = (int)floor(d->shift);
	struct delay_normal normal = {0};

	delay_columns(d, d->contact_mm);
	k_delay = normal.m = grid->columns;
	t->m = grid->columns + 3;
	for (int i = 0; i < grid->n; i++) {
		double *row = t->row + (size_t)i * t->m;

		t->rest[i] = delay_usable(d, i, whole) ? 0 : NAN;
		for (int k = 0; k < grid->columns && !isnan(t->rest[i]); k++)
			row[k] = delay_grid_at(grid->column[k], i, d->shift);
		if (!isnan(t->rest[i]))
			delay_add_row(&normal, row, grid->target[i]);
	}
	if (!delay_solve(&normal, d->c))
		return -1;
	for (int i = 0; i < grid->n; i++) {
		double *row = t->row + (size_t)i * t->m, slope = 0, sum = 0;

		if (isnan(t->rest[i]))
			continue;
		for (int k = 0; k < grid->columns; k++) {
			sum += d->c[k] * row[k];
			slope += d->c[k] *
				 (delay_grid_at(grid->column[k], i, d->shift + 0.5) -
				  delay_grid_at(grid->column[k], i, d->shift - 0.5));
		}
		row[k_delay] = slope;
		row[k_delay + 1] = 0;
		row[k_delay + 2] = slope * ((double)i / (grid->n - 1) - 0.5);
		t->rest[i] = grid->target[i] - sum;
		squares += t->rest[i] * t->rest[i];
	}
	for (int side = -1; d->touches && side <= 1; side += 2) {
		delay_columns(d, d->contact_mm + side * h);
		for (int i = 0; i < grid->n; i++)
			for (int k = 0; k < grid->columns && !isnan(t->rest[i]); k++)
				t->row[(size_t)i * t->m + k_delay + 1] +=
					side * d->c[k] / (2 * h) *
					delay_grid_at(grid->column[k], i, d->shift);
	}
	return squares;
}

void delay_tangent_normal(const struct delay_tangent *t, int from, int to, int without,
			  struct delay_normal *normal)
{
	memset(normal, 0, sizeof(*normal));
	normal->m = t->m - without;
	for (int i = from; i < to && i < t->n; i++)
		if (!isnan(t->rest[i]))
			delay_add_row(normal, t->row + (size_t)i * t->m, t->rest[i]);
}

/* Steps of delay and contact that make it better; a step that does not is halved. */
static bool refine(struct delay *d, struct delay_tangent *t)
{
	double step[DELAY_UNKNOWNS], scale = d->high_mm - d->low_mm, moved = 1;
	double squares = make_tangent(d, t), shift, contact;
	struct delay_normal normal;

	for (int pass = 0; pass < ITERATIONS && moved > 1e-4 && squares > 0; pass++) {
		delay_tangent_normal(t, 0, t->n, 1, &normal);
		if (!delay_solve(&normal, step))
			return false;
		shift = fmax(-3, fmin(3, step[d->grid.columns]));
		contact =
			fmax(-0.1 * scale, fmin(0.1 * scale, step[d->grid.columns + 1]));
		if (!d->touches)
			contact = 0;
		moved = fabs(shift) + fabs(contact) / scale;
		for (double share = 1; moved > 1e-4; share /= 2) {
			struct delay before = *d;
			double now;

			d->shift += share * shift;
			d->contact_mm += share * contact;
			/* contact that slips out of the motion begins nowhere */
			if (d->touches && (d->contact_mm <= d->floor_mm ||
					   d->contact_mm >= d->high_mm)) {
				d->touches = false;
				d->contact_mm = d->floor_mm;
			}
			if (fabs(d->shift) > d->range + BEYOND)
				return false;
			now = make_tangent(d, t);
			if ((now >= 0 && now <= squares) || share < 0.01) {
				squares = now;
				break;
			}
			d->shift = before.shift;
			d->contact_mm = before.contact_mm;
			d->touches = before.touches;
		}
	}
	return squares >= 0;
}

/* --- the whole ------------------------------------------------------------------------- */

static int measure_motion(struct delay *d, struct incise_error *err)
{
	struct delay_grid *grid = &d->grid;
	int n = 0;

	for (int i = 0; i < grid->n; i++)
		if (grid->good[i])
			grid->scratch[n++] = grid->motion[i];
	if (n < INCISE_DELAY_SPAN_MIN_S / DELAY_STEP_S / 2)
		return incise_error_set(err, EDOM,
					"too much of a stream is missing, or clipped; "
					"press less, record longer");
	qsort(grid->scratch, (size_t)n, sizeof(double), ascending);
	d->floor_mm = grid->scratch[0] - 1;
	d->low_mm = grid->scratch[n / 50];
	d->high_mm = grid->scratch[n - 1 - n / 50];
	if (d->high_mm - d->low_mm < MOTION_MIN_MM)
		return incise_error_set(err, EDOM,
					"the motion is %.2f mm only, %g are needed; tap "
					"farther",
					d->high_mm - d->low_mm, MOTION_MIN_MM);
	return 0;
}

static int fit_delay(struct delay *d, struct incise_delay_fit *fit,
		     struct incise_error *err)
{
	struct delay_grid *grid = &d->grid;
	struct delay_tangent t = {.n = grid->n};
	double rest = 0, all = 0;
	int rc = measure_motion(d, err);

	if (!rc)
		rc = delay_search(d, fit, err);
	if (rc)
		return rc;
	delay_search_contact(d);
	t.row = malloc((size_t)grid->n * DELAY_UNKNOWNS * sizeof(double));
	t.rest = malloc((size_t)grid->n * sizeof(double));
	if (!t.row || !t.rest)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	else if (!refine(d, &t))
		rc = incise_error_set(err, EDOM,
				      "no delay fits best; tap on something springy, "
				      "quickly and unevenly");
	if (!rc) {
		for (int i = 0; i < t.n; i++)
			if (!isnan(t.rest[i])) {
				rest += t.rest[i] * t.rest[i];
				all += grid->target[i] * grid->target[i];
			}
		fit->correlation = sqrt(fmax(0, 1 - rest / all));
		fit->delay_ms = d->shift * DELAY_STEP_S * 1e3;
		fit->contact_mm = d->touches ? d->contact_mm : NAN;
		rc = delay_bootstrap(d, &t, fit, err);
	}
	free(t.row);
	free(t.rest);
	if (rc)
		return rc;
	if (!(fit->sd_ms <= INCISE_DELAY_SD_MAX_MS))
		return incise_error_set(
			err, EDOM,
			"this motion tells the delay to ±%.1f ms only (%.1f ms); tap on, or "
			"press, something springy, quickly and unevenly",
			2 * fit->sd_ms, fit->delay_ms);
	return 0;
}

int incise_calibrate_delay(const struct incise_delay_point *motion, int n_motion,
			   const struct incise_delay_point *other, int n_other,
			   enum incise_delay_relation relation, double range_ms,
			   struct incise_delay_fit *fit, struct incise_error *err)
{
	struct delay d = {.relation = relation};
	int rc;

	*fit = (struct incise_delay_fit){.delay_ms = NAN,
					 .sd_ms = NAN,
					 .low_ms = NAN,
					 .high_ms = NAN,
					 .drift_ms = NAN,
					 .drift_sd_ms = NAN,
					 .contact_mm = NAN};
	if (!(range_ms >= 10 && range_ms <= 1000))
		return incise_error_set(
			err, EINVAL, "a range of %g ms is not from 10 to 1000", range_ms);
	rc = delay_grid_make(&d.grid, motion, n_motion, other, n_other, err);
	if (!rc) {
		fit->span_s = d.grid.n * DELAY_STEP_S;
		d.range = (int)ceil(range_ms * 1e-3 / DELAY_STEP_S);
		rc = fit_delay(&d, fit, err);
	}
	delay_grid_free(&d.grid);
	return rc;
}
