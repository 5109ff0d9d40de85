// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Delay between two streams of one motion; see incise/calibrate_delay.h. Delays are in
 * steps of the grid here.
 *
 *     target(i) ≈ Σ c_k · column_k(i + delay)       columns depend on where contact starts
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_delay.h>
#include "../base/ascending.h"
#include "../base/random.h"
#include "delay_grid.h"
#include "dense.h"

/* A fit under way. */
struct delay {
	struct delay_grid grid;
	enum incise_delay_relation relation;
	double low_mm, high_mm; /* of the motion: 2 and 98 % */
	double floor_mm;	/* it never is below */
	int range;		/* steps */
	/* The fit: */
	double shift, contact_mm, c[DELAY_COLUMNS];
	bool touches; /* contact starts within the motion, and is fitted along */
};

#define UNKNOWNS (DELAY_COLUMNS + 3) /* the others: delay, contact, drift */

/* Normal equations of some rows; the lower triangle. */
struct normal {
	int m;
	double a[UNKNOWNS * UNKNOWNS], b[UNKNOWNS], yy;
};

/* Rows of the derivatives by all unknowns at the present fit, and the rest. */
struct tangent {
	int n, m;
	double *row;  /* n × m: columns, delay, contact, drift */
	double *rest; /* n; NAN: not to be used */
};

/* --- least squares --- */

#define TINY 1e-12

static void add_calibrate_delay_row(struct normal *normal, const double *row, double y)
{
	int m = normal->m;

	for (int i = 0; i < m; i++) {
		normal->b[i] += row[i] * y;
		for (int j = 0; j <= i; j++)
			normal->a[i * m + j] += row[i] * row[j];
	}
	normal->yy += y * y;
}

static void add_normal(struct normal *to, const struct normal *from)
{
	for (int i = 0; i < to->m * to->m; i++)
		to->a[i] += from->a[i];
	for (int i = 0; i < to->m; i++)
		to->b[i] += from->b[i];
	to->yy += from->yy;
}

/* Columns are scaled alike first; one of zeros gets 0. False: singular. */
static bool solve_calibrate_delay(const struct normal *normal, double *x)
{
	double a[UNKNOWNS * UNKNOWNS] = {0}, scale[UNKNOWNS];
	int m = normal->m;

	for (int i = 0; i < m; i++) {
		double diagonal = normal->a[i * m + i];

		if (!(diagonal >= 0) || !isfinite(diagonal))
			return false;
		scale[i] = diagonal > 0 ? 1 / sqrt(diagonal) : 0;
	}
	for (int i = 0; i < m; i++) {
		for (int j = 0; j < i; j++)
			a[i * m + j] = normal->a[i * m + j] * scale[i] * scale[j];
		a[i * m + i] = 1 + TINY;
		x[i] = normal->b[i] * scale[i];
	}
	if (!incise_cholesky(a, m))
		return false;
	incise_cholesky_solve(a, m, x);
	for (int i = 0; i < m; i++)
		x[i] *= scale[i];
	return true;
}

/* Normal equations of rows from … to - 1, without the last `without` unknowns. */
static void tangent_normal(const struct tangent *t, int from, int to, int without,
			   struct normal *normal)
{
	memset(normal, 0, sizeof(*normal));
	normal->m = t->m - without;
	for (int i = from; i < to && i < t->n; i++)
		if (!isnan(t->rest[i]))
			add_calibrate_delay_row(normal, t->row + (size_t)i * t->m,
						t->rest[i]);
}

/* --- rough delay: the peak of the correlation, and the start of contact --- */

#define COARSE_KNOTS 5
#define COARSE_STRIDE 2 /* rows; neighbours are alike through the filter */
#define COARSE_LAG 2
#define CONTACTS 24
#define NEAR_LAGS 5

/* Speeds at which forces that grow with speed, either way, have half of their largest. */
#define SLOW_MM_S 10.0
#define FAST_MM_S 50.0

static void filter_column(struct delay_grid *grid, int k)
{
	delay_grid_filter(grid, grid->scratch, grid->column[k]);
}

/* The columns that the other stream is fitted by, for a contact that starts at a depth. */
static void make_columns(struct delay *d, double contact_mm)
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

/* True for rows that can be compared at a delay of @shift. */
static bool is_usable(const struct delay *d, int i, int shift)
{
	const struct delay_grid *grid = &d->grid;
	int from = i + shift - 2, to = i + shift + 3;

	return grid->good[i] && from >= 0 && to < grid->n && grid->good[from] &&
	       grid->good[to];
}

static void coarse_normal(const struct delay *d, int shift, struct normal *normal)
{
	const struct delay_grid *grid = &d->grid;
	double row[UNKNOWNS];

	memset(normal, 0, sizeof(*normal));
	normal->m = grid->columns;
	for (int i = 0; i < grid->n; i += COARSE_STRIDE) {
		if (!is_usable(d, i, shift))
			continue;
		for (int k = 0; k < grid->columns; k++)
			row[k] = grid->column[k][i + shift];
		add_calibrate_delay_row(normal, row, grid->target[i]);
	}
}

/* Correlation of the target and its fit by the columns; negative for a mirror image. */
static double correlation(const struct normal *normal)
{
	double x[UNKNOWNS], explained = 0, slope = 0;
	int m = normal->m;

	if (!(normal->yy > 0) || !solve_calibrate_delay(normal, x))
		return 0;
	for (int k = 0; k < m; k++) {
		explained += x[k] * normal->b[k];
		/* with the first column, which is the motion itself */
		slope += x[k] * normal->a[k * m];
	}
	explained = sqrt(fmax(0, fmin(1, explained / normal->yy)));
	return slope < 0 ? -explained : explained;
}

static int search_calibrate_delay(struct delay *d, struct incise_delay_fit *fit,
				  struct incise_error *err)
{
	int lags = 2 * (d->range / COARSE_LAG) + 1, best = 0;
	double *r = calloc((size_t)lags, sizeof(*r));
	double second = 0, peak;

	if (!r)
		return incise_error_set(err, ENOMEM, "out of memory");
	make_coarse_columns(d);
	for (int l = 0; l < lags; l++) {
		struct normal normal;

		coarse_normal(d, (l - lags / 2) * COARSE_LAG, &normal);
		r[l] = correlation(&normal);
		if (r[l] > r[best])
			best = l;
	}
	peak = r[best];
	for (int l = 1; l < lags - 1; l++)
		if (l != best && r[l] >= r[l - 1] && r[l] >= r[l + 1])
			second = fmax(second, r[l]);
	/* one that still rises at the end may have any height beyond */
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
			"the streams correlate too little (%.2f, at least %g is "
			"required); tap or press on elastic material, quickly and "
			"irregularly",
			peak, INCISE_DELAY_CORRELATION_MIN);
	if (fit->second > INCISE_DELAY_SECOND_MAX)
		return incise_error_set(err, EDOM,
					"the motion is periodic: another delay fits "
					"%.0f %% as well; tap irregularly",
					100 * fit->second);
	if (best == 0 || best == lags - 1)
		return incise_error_set(err, EDOM,
					"the delay is beyond %.0f ms; increase the "
					"range",
					d->range * DELAY_STEP_S * 1e3);
	return 0;
}

/* Share that the present columns do not explain; HUGE_VAL where they have no solution. */
static double coarse_rest(const struct delay *d, int shift)
{
	struct normal normal;
	double x[UNKNOWNS], rest;

	coarse_normal(d, shift, &normal);
	if (!(normal.yy > 0) || !solve_calibrate_delay(&normal, x))
		return HUGE_VAL;
	rest = normal.yy;
	for (int k = 0; k < normal.m; k++)
		rest -= x[k] * normal.b[k];
	return rest / normal.yy;
}

/*
 * Choose the depth at which contact starts, and the delay again, as viscosity has moved the
 * peak of the correlation; the fit starts from there.
 */
static void search_contact(struct delay *d)
{
	double least = HUGE_VAL;
	int middle = (int)d->shift;

	d->contact_mm = d->floor_mm;
	for (int at = 0; at < CONTACTS; at++) {
		double contact = at ? d->low_mm + (at - 0.5) * 0.8 *
							  (d->high_mm - d->low_mm) /
							  CONTACTS
				    : d->floor_mm;

		make_columns(d, contact);
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

/* --- uncertainty --- */

#define BLOCK_S 1.0
#define BLOCKS_MIN 7
#define DRAWS 400

/* Standard deviation of n values; few blocks have Student's tails, which k = 2 holds. */
static double spread(const double *value, int n, int blocks)
{
	double mean = 0, sum = 0, freedom = blocks - 2;

	for (int i = 0; i < n; i++)
		mean += value[i] / n;
	for (int i = 0; i < n; i++)
		sum += (value[i] - mean) * (value[i] - mean);
	return sqrt(sum / (n - 1) * blocks / freedom) * (1 + 1.21 / freedom);
}

/* Draw blocks of the run with replacement, many times, and solve each time. */
static int bootstrap(struct delay *d, const struct tangent *t,
		     struct incise_delay_fit *fit, struct incise_error *err)
{
	int length = (int)(BLOCK_S / DELAY_STEP_S), n = t->n / length, used = 0;
	int at = d->grid.columns;
	struct normal *blocks = malloc((size_t)(n + 1) * sizeof(*blocks));
	double delays[DRAWS], drifts[DRAWS], x[UNKNOWNS], wider, plain, ms;
	uint64_t state = 1;

	if (!blocks)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int b = 0; b < n; b++) {
		tangent_normal(t, b * length, (b + 1) * length, 0, &blocks[used]);
		used += blocks[used].yy > 0;
	}
	fit->blocks = used;
	if (used < BLOCKS_MIN) {
		free(blocks);
		return incise_error_set(err, EDOM,
					"too much of the motion is missing; record "
					"longer");
	}
	for (int draw = 0; draw < DRAWS; draw++) {
		struct normal sum = {.m = t->m}, without;

		for (int b = 0; b < used; b++)
			add_normal(&sum,
				   &blocks[incise_random_draw(&state, (uint32_t)used)]);
		drifts[draw] = solve_calibrate_delay(&sum, x) ? x[t->m - 1] : 0;
		without = (struct normal){.m = t->m - 1, .yy = sum.yy};
		for (int i = 0; i < without.m; i++) {
			without.b[i] = sum.b[i];
			for (int j = 0; j <= i; j++)
				without.a[i * without.m + j] = sum.a[i * sum.m + j];
		}
		delays[draw] = solve_calibrate_delay(&without, x) ? x[at] : 0;
	}
	ms = DELAY_STEP_S * 1e3;
	fit->sd_ms = spread(delays, DRAWS, used) * ms;
	fit->drift_sd_ms = spread(drifts, DRAWS, used) * ms;
	{
		struct normal sum = {.m = t->m};

		for (int b = 0; b < used; b++)
			add_normal(&sum, &blocks[b]);
		fit->drift_ms = solve_calibrate_delay(&sum, x) ? x[t->m - 1] * ms : NAN;
	}
	free(blocks);
	/* the quantiles are widened as the standard deviation was */
	qsort(delays, DRAWS, sizeof(*delays), ascending);
	plain = 0;
	for (int i = 0; i < DRAWS; i++)
		plain += delays[i] * delays[i] / DRAWS;
	wider = plain > 0 ? fit->sd_ms / (sqrt(plain) * ms) : 1;
	fit->low_ms = fit->delay_ms + delays[DRAWS / 40] * wider * ms;
	fit->high_ms = fit->delay_ms + delays[DRAWS - 1 - DRAWS / 40] * wider * ms;
	return 0;
}

#define MOTION_MIN_MM 1.0
#define ITERATIONS 12
#define BEYOND 2 /* steps that a fit may leave the range by */

/* --- the fit --- */

/* Sum of squares of the rest, with the best coefficients for the present delay and contact;
 * negative: there are none. */
static double make_tangent(struct delay *d, struct tangent *t)
{
	struct delay_grid *grid = &d->grid;
	double h = 0.02 * (d->high_mm - d->low_mm), squares = 0;
	int k_delay, whole = (int)floor(d->shift);
	struct normal normal = {0};

	make_columns(d, d->contact_mm);
	k_delay = normal.m = grid->columns;
	t->m = grid->columns + 3;
	for (int i = 0; i < grid->n; i++) {
		double *row = t->row + (size_t)i * t->m;

		t->rest[i] = is_usable(d, i, whole) ? 0 : NAN;
		for (int k = 0; k < grid->columns && !isnan(t->rest[i]); k++)
			row[k] = delay_grid_at(grid->column[k], i, d->shift);
		if (!isnan(t->rest[i]))
			add_calibrate_delay_row(&normal, row, grid->target[i]);
	}
	if (!solve_calibrate_delay(&normal, d->c))
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
		make_columns(d, d->contact_mm + side * h);
		for (int i = 0; i < grid->n; i++)
			for (int k = 0; k < grid->columns && !isnan(t->rest[i]); k++)
				t->row[(size_t)i * t->m + k_delay + 1] +=
					side * d->c[k] / (2 * h) *
					delay_grid_at(grid->column[k], i, d->shift);
	}
	return squares;
}

/* Improve delay and contact by steps; one that does not improve them is halved. */
static bool refine(struct delay *d, struct tangent *t)
{
	double step[UNKNOWNS], scale = d->high_mm - d->low_mm, moved = 1;
	double squares = make_tangent(d, t), shift, contact;
	struct normal normal;

	for (int pass = 0; pass < ITERATIONS && moved > 1e-4 && squares > 0; pass++) {
		tangent_normal(t, 0, t->n, 1, &normal);
		if (!solve_calibrate_delay(&normal, step))
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
			/* contact outside of the motion has no start */
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
					"the motion has only %.2f mm, at least %g are "
					"required; move farther",
					d->high_mm - d->low_mm, MOTION_MIN_MM);
	return 0;
}

static int fit_delay(struct delay *d, struct incise_delay_fit *fit,
		     struct incise_error *err)
{
	struct delay_grid *grid = &d->grid;
	struct tangent t = {.n = grid->n};
	double rest = 0, all = 0;
	int rc = measure_motion(d, err);

	if (!rc)
		rc = search_calibrate_delay(d, fit, err);
	if (rc)
		return rc;
	search_contact(d);
	t.row = malloc((size_t)grid->n * UNKNOWNS * sizeof(double));
	t.rest = malloc((size_t)grid->n * sizeof(double));
	if (!t.row || !t.rest)
		rc = incise_error_set(err, ENOMEM, "out of memory");
	else if (!refine(d, &t))
		rc = incise_error_set(err, EDOM,
				      "no delay fits best; tap on elastic material, "
				      "quickly and irregularly");
	if (!rc) {
		for (int i = 0; i < t.n; i++)
			if (!isnan(t.rest[i])) {
				rest += t.rest[i] * t.rest[i];
				all += grid->target[i] * grid->target[i];
			}
		fit->correlation = sqrt(fmax(0, 1 - rest / all));
		fit->delay_ms = d->shift * DELAY_STEP_S * 1e3;
		fit->contact_mm = d->touches ? d->contact_mm : NAN;
		rc = bootstrap(d, &t, fit, err);
	}
	free(t.row);
	free(t.rest);
	if (rc)
		return rc;
	if (!(fit->sd_ms <= INCISE_DELAY_SD_MAX_MS))
		return incise_error_set(
			err, EDOM,
			"the interval of the delay, ±%.1f ms, is too wide (%.1f ms); "
			"tap or press on elastic material, quickly and irregularly",
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
			err, EINVAL, "a range of %g ms: expected 10 to 1000", range_ms);
	rc = delay_grid_make(&d.grid, motion, n_motion, other, n_other, err);
	if (!rc) {
		fit->span_s = d.grid.n * DELAY_STEP_S;
		d.range = (int)ceil(range_ms * 1e-3 / DELAY_STEP_S);
		rc = fit_delay(&d, fit, err);
	}
	delay_grid_free(&d.grid);
	return rc;
}
