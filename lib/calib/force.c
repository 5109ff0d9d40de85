// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Sensitivity of the force channel: what is refused, what is left out, and the order of it
 * all; see incise/calibrate_force.h. The line itself is in force_line.c, what is told of the
 * sensor in force_figures.c.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "force_work.h"
#include "robust_line.h"

/* This near an end, as a share of the converter's range, noise is cut off: 10 mV of 5 V. */
#define MARGIN 0.002
/* Readings are alike within this share of all that was read. */
#define ALIKE 0.001
/* Readings of one load may scatter by this share of what the largest load makes. */
#define SCATTER_MAX 0.02
/* Outliers that are borne, as a share of the pairs. */
#define OUTLIERS_MAX 0.1

void incise_calibrate_force_init(struct incise_calibrate_force_setup *setup)
{
	*setup = (struct incise_calibrate_force_setup){
		.gravity_m_s2 = 9.80665,
		/* 9.78 at the equator, 9.83 at the poles, 9.77 on high ground: ±0.03 */
		.gravity_u_m_s2 = 0.0173,
		.air_kg_m3 = 1.2,
		.air_u_kg_m3 = 0.058,
		.weight_kg_m3 = 7950,
		.weight_u_kg_m3 = 350,
		.scale_g = 0.5,
		.low_mV = NAN,
		.high_mV = NAN,
		.nominal_mV_N = 1240,
		.tolerance = 0.05,
	};
}

double incise_calibrate_force_of(const struct incise_calibrate_force_pair *pair,
				 const struct incise_calibrate_force_setup *setup)
{
	if (isnan(pair->mass_g))
		return pair->force_N;
	return pair->mass_g * 1e-3 * setup->gravity_m_s2 *
	       (1 - setup->air_kg_m3 / setup->weight_kg_m3);
}

static int check_pairs(const struct incise_calibrate_force_pair *pairs, int n,
		       struct incise_error *err)
{
	for (int i = 0; i < n; i++) {
		const struct incise_calibrate_force_pair *p = &pairs[i];
		bool load = isnan(p->mass_g) ? p->force_N >= 0 && p->force_N <= 1e4
					     : p->mass_g >= 0 && p->mass_g <= 1e6;

		if (!load)
			return incise_error_set(
				err, EINVAL,
				"pair %d: a load of %.10g %s: expected 0 to "
				"1e6 g or 1e4 N; correct it",
				i + 1, isnan(p->mass_g) ? p->force_N : p->mass_g,
				isnan(p->mass_g) ? "N" : "g");
		if (!(fabs(p->reading_mV) <= 1e6))
			return incise_error_set(
				err, EINVAL,
				"pair %d: a reading of %.10g mV: expected at "
				"most 1e6; correct it",
				i + 1, p->reading_mV);
	}
	return 0;
}

static bool positive(double value)
{
	return value > 0 && isfinite(value);
}

static int check_setup(const struct incise_calibrate_force_setup *s,
		       struct incise_error *err)
{
	const double not_below_0[] = {s->gravity_u_m_s2, s->air_kg_m3, s->air_u_kg_m3,
				      s->weight_u_kg_m3, s->scale_g,   s->step_mV};
	bool fine = positive(s->gravity_m_s2) && positive(s->weight_kg_m3) &&
		    positive(s->nominal_mV_N) && positive(s->tolerance) &&
		    s->air_kg_m3 < s->weight_kg_m3 && !(s->low_mV >= s->high_mV);

	for (size_t i = 0; i < sizeof(not_below_0) / sizeof(*not_below_0); i++)
		fine &= not_below_0[i] >= 0 && isfinite(not_below_0[i]);
	return fine ? 0
		    : incise_error_set(
			      err, EINVAL,
			      "the setup of the calibration: gravity, densities, "
			      "scale, range and tolerance are to be positive");
}

static bool near(double ratio, double expected)
{
	return ratio > 0.7 * expected && ratio < 1.4 * expected;
}

/*
 * What a slope that is off by a known factor is a sign of. Columns are swapped where the
 * inverse of the slope, with loads in the unit of the column, is the nominal sensitivity.
 */
static int check_slope(const struct work *w, double slope, struct incise_error *err)
{
	const double nominal = w->setup->nominal_mV_N, ratio = slope / nominal;
	const double N_g = 1e-3 * w->setup->gravity_m_s2;
	const char *sign = NULL;
	/* swapped, each "reading" is a load in the unit of the load's column */
	double unit = w->masses ? N_g : 1;

	if (near(1 / (slope * unit * unit), nominal))
		sign = "the columns of loads and readings are swapped";
	else if (near(ratio, 1e3) && w->masses)
		sign = "the masses seem to be in kg, not g";
	else if (near(ratio, 1e-3))
		sign = "the readings seem to be in V, not mV";
	else if (near(ratio, N_g) && !w->masses)
		sign = "the forces seem to be masses in g";
	else if (near(ratio, 1 / N_g) && w->masses)
		sign = "the masses seem to be forces in N";
	else if (!(slope > 0))
		sign = "the reading does not grow with the load: see how the sensor is wired";
	return sign ? incise_error_set(err, EDOM,
				       "a slope of %.4g mV/N cannot be, where %.4g is "
				       "expected: %s",
				       slope, nominal, sign)
		    : 0;
}

/*
 * The reading that all loads from one on (@top: upwards) share, though they are clearly apart;
 * NAN: none. A weight that was noted wrong makes none: others of its load read otherwise.
 */
static double plateau(const struct work *w, bool top)
{
	double low = INFINITY, high = -INFINITY, F_min = INFINITY, F_max = 0;
	double least = INFINITY, most = -INFINITY, end, near_mV;

	for (int i = 0; i < w->n; i++) {
		least = fmin(least, w->y[i]);
		most = fmax(most, w->y[i]);
		F_min = fmin(F_min, w->F[i]);
		F_max = fmax(F_max, w->F[i]);
	}
	near_mV = ALIKE * (most - least);
	end = top ? most : least;
	for (int i = 0; i < w->n; i++)
		if (fabs(w->y[i] - end) <= near_mV) {
			low = fmin(low, w->F[i]);
			high = fmax(high, w->F[i]);
		}
	/* a hundredth of the load would be ten times as far apart */
	if (high - low <= 10 * ALIKE * F_max || (top ? high < F_max : low > F_min))
		return NAN;
	for (int i = 0; i < w->n; i++)
		if (w->F[i] >= low && w->F[i] <= high && fabs(w->y[i] - end) > near_mV)
			return NAN;
	return end;
}

/* Mark what is saturated; returns how many. */
static int mark_saturated(struct work *w)
{
	const struct incise_calibrate_force_setup *s = w->setup;
	const double margin = isfinite(s->low_mV) && isfinite(s->high_mV)
				      ? MARGIN * (s->high_mV - s->low_mV)
				      : 1.5 * s->step_mV;
	const double ends[2] = {plateau(w, false), plateau(w, true)};
	double span = 0;
	int found = 0;

	for (int i = 0; i < w->n; i++)
		span = fmax(span, fabs(w->y[i] - w->y[0])); /* half of it, or more */
	for (int i = 0; i < w->n; i++) {
		bool ended =
			w->y[i] <= s->low_mV + margin || w->y[i] >= s->high_mV - margin;

		for (int k = 0; k < 2; k++)
			ended |= fabs(w->y[i] - ends[k]) <= ALIKE * span;
		if (!ended)
			continue;
		w->states[i] = INCISE_CALIBRATE_FORCE_SATURATED;
		found++;
	}
	return found;
}

/* Different loads among the pairs that are used. */
static int count_loads(struct work *w)
{
	incise_calibrate_force_loads(w);
	return w->n_loads;
}

static int check_loads(struct work *w, struct incise_error *err)
{
	int loads = count_loads(w), used = 0;

	for (int i = 0; i < w->n; i++)
		used += w->states[i] == INCISE_CALIBRATE_FORCE_USED;
	if (loads >= 3 && used >= 5)
		return 0;
	if (used < w->n)
		return incise_error_set(
			err, ENODATA,
			"%d pairs are saturated or wrong; %d pairs of %d different loads are "
			"left, and 5 of 3 are needed: use smaller weights",
			w->n - used, used, loads);
	if (loads == 1)
		return incise_error_set(
			err, ENODATA,
			"all %d pairs are of one load: one repeated weight "
			"has no slope; use 5 loads or more",
			used);
	return incise_error_set(err, ENODATA,
				"%d pairs of %d different loads: 5 pairs of 3 loads are "
				"the least; 5 loads in 3 series are good",
				used, loads);
}

static int mark_outliers(struct work *w, struct incise_error *err)
{
	double *x = malloc(w->n * sizeof(*x)), *y = malloc(w->n * sizeof(*y));
	int *from = malloc(w->n * sizeof(*from)), m = 0, found = 0, rc = -ENOMEM;
	bool *outlier = malloc(w->n * sizeof(*outlier));
	struct robust_line line;

	if (x && y && from && outlier) {
		for (int i = 0; i < w->n; i++)
			if (w->states[i] == INCISE_CALIBRATE_FORCE_USED) {
				x[m] = w->F[i];
				y[m] = w->y[i];
				from[m++] = i;
			}
		/* What rounding by scale and converter explains is no outlier. */
		rc = incise_robust_line(x, y, m,
					hypot(w->setup->nominal_mV_N * w->load_u_N,
					      w->setup->step_mV / sqrt(12)),
					&line, outlier);
	}
	for (int k = 0; k < m && !rc; k++)
		if (outlier[k]) {
			w->states[from[k]] = INCISE_CALIBRATE_FORCE_OUTLIER;
			found++;
		}
	free(x);
	free(y);
	free(from);
	free(outlier);
	if (rc)
		return incise_error_set(err, -rc,
					rc == -ENOMEM ? "no memory for %d pairs"
						      : "%d pairs carry no line",
					w->n);
	w->robust_slope = line.slope;
	if (found > OUTLIERS_MAX * m)
		return incise_error_set(
			err, EDOM,
			"%d of %d pairs lie far from the line of the others, and one in ten "
			"is borne: repeat the calibration (the report lists them)",
			found, m);
	return 0;
}

/* What is wrong is named before it is left out: a slope of all that was read. */
static int check_whole(struct work *w, struct incise_error *err)
{
	bool *outlier = malloc(w->n * sizeof(*outlier));
	struct robust_line line;
	int rc = outlier ? incise_robust_line(w->F, w->y, w->n, 0, &line, outlier)
			 : -ENOMEM;

	free(outlier);
	if (rc == -ENOMEM)
		return incise_error_set(err, ENOMEM, "no memory for %d pairs", w->n);
	/* No line: the loads tell why, below. A reading that falls may be a saturated one. */
	return rc || !(line.slope > 0) ? 0 : check_slope(w, line.slope, err);
}

static int fit(struct work *w, struct incise_calibrate_force *result,
	       struct incise_error *err)
{
	int rc;

	for (int i = 0; i < w->n; i++)
		w->F[i] = incise_calibrate_force_of(&w->pairs[i], w->setup);
	rc = check_loads(w, err);
	if (!rc)
		rc = check_whole(w, err);
	if (!rc && mark_saturated(w))
		rc = check_loads(w, err);
	if (!rc)
		rc = mark_outliers(w, err);
	if (!rc)
		rc = check_slope(w, w->robust_slope, err);
	if (!rc)
		rc = check_loads(w, err);
	if (rc)
		return rc;
	incise_calibrate_force_line(w, result);
	if (result->residual_sd_mV >
	    SCATTER_MAX * result->sensitivity_mV_N * w->loads[w->n_loads - 1].F_N)
		return incise_error_set(
			err, EDOM,
			"the readings scatter by %.3g mV about their line, "
			"more than %g %% of full scale: wait until each is "
			"steady, and look for wrong loads",
			result->residual_sd_mV, 100 * SCATTER_MAX);
	incise_calibrate_force_figures(w, result);
	result->pass = fabs(result->sensitivity_mV_N - w->setup->nominal_mV_N) <=
		       w->setup->tolerance * w->setup->nominal_mV_N;
	return 0;
}

int incise_calibrate_force(const struct incise_calibrate_force_pair *pairs, int n,
			   const struct incise_calibrate_force_setup *setup,
			   struct incise_calibrate_force *result,
			   enum incise_calibrate_force_state *states,
			   struct incise_error *err)
{
	struct work w = {.pairs = pairs, .n = n, .setup = setup};
	int rc = check_setup(setup, err);

	if (!rc && n < 1)
		rc = incise_error_set(err, ENODATA, "no pairs of loads and readings");
	if (!rc)
		rc = check_pairs(pairs, n, err);
	if (rc)
		return rc;
	*result = (struct incise_calibrate_force){.pairs = n};
	w.load_u_N = setup->scale_g * 1e-3 * setup->gravity_m_s2 / sqrt(12);
	w.states = calloc(n, sizeof(*w.states));
	w.F = malloc(n * sizeof(*w.F));
	w.y = malloc(n * sizeof(*w.y));
	w.load_of = malloc(n * sizeof(*w.load_of));
	w.loads = malloc(n * sizeof(*w.loads));
	if (w.states && w.F && w.y && w.load_of && w.loads) {
		for (int i = 0; i < n; i++) {
			w.y[i] = pairs[i].reading_mV;
			w.masses |= !isnan(pairs[i].mass_g);
		}
		rc = fit(&w, result, err);
	} else {
		rc = incise_error_set(err, ENOMEM, "no memory for %d pairs", n);
	}
	for (int i = 0; i < n && w.states; i++) {
		result->used += w.states[i] == INCISE_CALIBRATE_FORCE_USED;
		result->saturated += w.states[i] == INCISE_CALIBRATE_FORCE_SATURATED;
		result->outliers += w.states[i] == INCISE_CALIBRATE_FORCE_OUTLIER;
		if (states)
			states[i] = w.states[i];
	}
	free(w.states);
	free(w.F);
	free(w.y);
	free(w.load_of);
	free(w.loads);
	return rc;
}
