// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Sensitivity of the force channel; see incise/calibrate_force.h. Constants of gravity are
 * those of WGS 84, NIMA TR8350.2, tables 3.1 to 3.4.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/calibrate_force.h>
#include "chi2.h"
#include "robust_line.h"

/* Pairs of one load: weighed once, so that they share the rounding of the scale. */
struct load {
	double F_N;
	double mean_mV; /* of the readings used */
	int n;
	/* For the line: variance of the mean by scatter, common error, and weight. */
	double own2, common_mV, weight;
};

struct calibrate_force_work {
	const struct incise_calibrate_force_pair *pairs;
	const struct incise_calibrate_force_setup *setup;
	int n;
	double *F, *y; /* N, mV */
	enum incise_calibrate_force_state *states;
	int *load_of;	    /* of a pair, in loads; -1: not used */
	struct load *loads; /* by rising force */
	int n_loads;
	bool masses;	 /* some loads are masses */
	double load_u_N; /* of a load by the scale; an empty pan has none */
	double robust_slope;
};

/*
 * --- the line and its budget ---
 *
 * The readings of a load share the error of the weight, which more readings do not take away:
 * the variance of a load's mean is scatter²/n + (S u_load)², and its inverse the weight. The
 * slope is then S = Σ c_k mean_k, and each source adds by these c_k (GUM, JCGM 100:2008, 5.1.2).
 */

static int by_force(const void *a, const void *b)
{
	double x = ((const struct load *)a)->F_N, y = ((const struct load *)b)->F_N;

	return (x > y) - (x < y);
}

/* Gather the pairs that are used into loads. */
static void gather_loads(struct calibrate_force_work *w)
{
	double most = 0;

	w->n_loads = 0;
	for (int i = 0; i < w->n; i++)
		most = fmax(most, w->F[i]);
	for (int i = 0; i < w->n; i++)
		if (w->states[i] == INCISE_CALIBRATE_FORCE_USED)
			w->loads[w->n_loads++] = (struct load){.F_N = w->F[i]};
	qsort(w->loads, w->n_loads, sizeof(*w->loads), by_force);
	for (int k = 0, all = w->n_loads; k < all; k++) {
		if (!k)
			w->n_loads = 0;
		/* the same but for the last digits of a file */
		if (!k || w->loads[k].F_N - w->loads[w->n_loads - 1].F_N > 1e-6 * most)
			w->loads[w->n_loads++] = w->loads[k];
	}
	for (int i = 0; i < w->n; i++) {
		int low = 0, high = w->n_loads - 1;

		w->load_of[i] = -1;
		if (w->states[i] != INCISE_CALIBRATE_FORCE_USED)
			continue;
		while (low < high) {
			int middle = (low + high + 1) / 2;

			if (w->loads[middle].F_N <= w->F[i])
				low = middle;
			else
				high = middle - 1;
		}
		w->load_of[i] = low;
		w->loads[low].n++;
		w->loads[low].mean_mV +=
			(w->y[i] - w->loads[low].mean_mV) / w->loads[low].n;
	}
}

/* Two-sided 95 % of Student's t, by the series of Abramowitz and Stegun 26.7.5. */
static double student(int freedom)
{
	static const double first[] = {12.706, 4.303, 3.182, 2.776};
	const double z = 1.959964, v = freedom;

	if (freedom < 5)
		return first[freedom < 1 ? 0 : freedom - 1];
	return z + (pow(z, 3) + z) / (4 * v) +
	       (5 * pow(z, 5) + 16 * pow(z, 3) + 3 * z) / (96 * v * v);
}

/* The scatter of readings of one load, pooled; without repetition the one about a line. */
static void measure_scatter(const struct calibrate_force_work *w,
			    struct incise_calibrate_force *result)
{
	double squares = 0;
	int used = 0;

	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] >= 0) {
			double r = w->y[i] - w->loads[w->load_of[i]].mean_mV;

			squares += r * r;
			used++;
		}
	result->freedom = used - w->n_loads;
	if (result->freedom >= 3) {
		result->scatter_sd_mV = sqrt(squares / result->freedom);
		return;
	}
	/* The scale's share is in it twice then, which is on the safe side. */
	double mx = 0, my = 0, xx = 0, xy = 0;

	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] >= 0) {
			mx += w->F[i] / used;
			my += w->y[i] / used;
		}
	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] >= 0) {
			xx += (w->F[i] - mx) * (w->F[i] - mx);
			xy += (w->F[i] - mx) * (w->y[i] - my);
		}
	squares = 0;
	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] >= 0) {
			double r = w->y[i] - my - xy / xx * (w->F[i] - mx);

			squares += r * r;
		}
	result->freedom = used - 2;
	result->scatter_sd_mV = sqrt(squares / result->freedom);
}

/* A load's readings share the error of its weight, and a code without noise. */
static void weigh_loads(struct calibrate_force_work *w, double slope, double code_u_mV,
			double scatter_sd_mV)
{
	for (int k = 0; k < w->n_loads; k++) {
		struct load *load = &w->loads[k];

		load->own2 = scatter_sd_mV * scatter_sd_mV / load->n;
		load->common_mV =
			hypot(load->F_N > 0 ? slope * w->load_u_N : 0, code_u_mV);
		/* data without any scatter weigh alike */
		load->weight =
			1 / (load->own2 + load->common_mV * load->common_mV + 1e-12);
	}
}

static void add_calibrate_force_part(struct incise_calibrate_force *result,
				     const char *source, char type, double u,
				     const char *unit, double u_mV_N)
{
	result->budget.part[result->budget.n++] = (struct incise_calibration_part){
		source, type, u, unit, u > 0 ? u_mV_N / u : 0, u_mV_N};
}

/* Sources that turn all loads alike. */
static void add_common(const struct calibrate_force_work *w,
		       struct incise_calibrate_force *result)
{
	const struct incise_calibrate_force_setup *s = w->setup;
	const double S = result->sensitivity_mV_N;

	if (!w->masses)
		return;
	add_calibrate_force_part(result, "gravity", 'B', s->gravity_u_m_s2, "m/s2",
				 S * s->gravity_u_m_s2 / s->gravity_m_s2);
	add_calibrate_force_part(result, "density of air", 'B', s->air_u_kg_m3, "kg/m3",
				 S * s->air_u_kg_m3 / s->weight_kg_m3);
	add_calibrate_force_part(result, "density of the weights", 'B', s->weight_u_kg_m3,
				 "kg/m3",
				 S * s->air_kg_m3 * s->weight_u_kg_m3 /
					 (s->weight_kg_m3 * s->weight_kg_m3));
}

static void fit_calibrate_force_line(struct calibrate_force_work *w,
				     struct incise_calibrate_force *result)
{
	double slope = w->robust_slope, zero = 0, code_u_mV = 0, t;
	double sw = 0, mx = 0, my = 0, sxx = 0, chi2 = 0;
	double scatter2 = 0, scale2 = 0, code2 = 0, squares = 0, u2 = 0;
	double turn; /* factor of type A, so that k = 2 is 95 % for its few readings */

	measure_scatter(w, result);
	/* Noise of half a code and more makes means finer than a code. */
	if (!w->setup->dithered && result->scatter_sd_mV < w->setup->step_mV / 2)
		code_u_mV = w->setup->step_mV / sqrt(12);
	t = student(result->freedom);
	turn = fmax(t / 2, 1);
	/* The weights depend on the slope, which two rounds settle. */
	for (int round = 0; round < 3; round++) {
		double sxy = 0;

		sw = mx = my = sxx = 0;
		weigh_loads(w, slope, code_u_mV, result->scatter_sd_mV);
		for (int k = 0; k < w->n_loads; k++) {
			sw += w->loads[k].weight;
			mx += w->loads[k].weight * w->loads[k].F_N;
			my += w->loads[k].weight * w->loads[k].mean_mV;
		}
		mx /= sw;
		my /= sw;
		for (int k = 0; k < w->n_loads; k++) {
			const struct load *load = &w->loads[k];

			sxx += load->weight * (load->F_N - mx) * (load->F_N - mx);
			sxy += load->weight * (load->F_N - mx) * (load->mean_mV - my);
		}
		slope = sxy / sxx;
		zero = my - slope * mx;
	}
	weigh_loads(w, slope, code_u_mV, result->scatter_sd_mV);
	for (int k = 0; k < w->n_loads; k++) {
		const struct load *load = &w->loads[k];
		double c = load->weight * (load->F_N - mx) / sxx;
		double r = load->mean_mV - zero - slope * load->F_N;

		chi2 += load->weight * r * r;
		scatter2 += c * c * load->own2;
		code2 += c * c * code_u_mV * code_u_mV;
		scale2 += c * c *
			  (load->common_mV * load->common_mV - code_u_mV * code_u_mV);
	}
	result->loads = w->n_loads;
	result->sensitivity_mV_N = slope;
	result->zero_mV = zero;
	result->misfit = 1;
	if (w->n_loads > 2 && chi2 > chi2_99(w->n_loads - 2))
		result->misfit = sqrt(chi2 / (w->n_loads - 2));
	scatter2 *= turn * turn * result->misfit * result->misfit;
	scale2 = fmax(scale2, 0) * result->misfit * result->misfit;
	add_calibrate_force_part(result, "scatter of readings", 'A',
				 result->scatter_sd_mV, "mV", sqrt(scatter2));
	add_calibrate_force_part(result, "resolution of the scale", 'B', w->load_u_N, "N",
				 sqrt(scale2));
	if (code_u_mV > 0)
		add_calibrate_force_part(result, "resolution of the converter", 'B',
					 code_u_mV, "mV", sqrt(code2));
	add_common(w, result);
	for (int i = 0; i < result->budget.n; i++)
		u2 += result->budget.part[i].contribution *
		      result->budget.part[i].contribution;
	result->sensitivity_u_mV_N = sqrt(u2);
	/* The line alone counts: an error common to all loads does not move the zero. */
	double line2 = scatter2 + scale2 + code2;

	result->covariance = -mx * line2;
	result->zero_u_mV = sqrt(mx * mx * line2 +
				 turn * turn * result->misfit * result->misfit / sw);
	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] >= 0) {
			double r = w->y[i] - zero - slope * w->F[i];

			squares += r * r;
			result->used++;
		}
	result->residual_sd_mV = sqrt(squares / (result->used - 2));
	result->used = 0; /* counted with the others, by the caller */
}

/*
 * --- metrics of the sensor ---
 *
 * Linearity, hysteresis, repeatability and zero return, in the words of ISO 376, in percent of
 * full scale: the reading of the largest load above the zero.
 */

/* Readings of one load, reached one way. */
struct way {
	double sum, least, most;
	int n;
};

static void take_calibrate_force(struct way *way, double reading)
{
	if (!way->n || reading < way->least)
		way->least = reading;
	if (!way->n || reading > way->most)
		way->most = reading;
	way->sum += reading;
	way->n++;
}

/* Readings of a load by both ways. */
static void gather_calibrate_force(const struct calibrate_force_work *w, int load,
				   struct way *up, struct way *down)
{
	*up = *down = (struct way){0};
	for (int i = 0; i < w->n; i++)
		if (w->load_of[i] == load)
			take_calibrate_force(w->pairs[i].descending ? down : up, w->y[i]);
}

static bool is_first_of_series(const struct calibrate_force_work *w, int i)
{
	for (int j = 0; j < i; j++)
		if (w->pairs[j].series == w->pairs[i].series)
			return false;
	return true;
}

/* Zero after the loads of a series less the one before; NAN: one is missing. */
static double zero_return_mV(const struct calibrate_force_work *w, int series)
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

/* fmax() takes the number where one of two is NaN: metrics start as not stated. */
static void measure_metrics(const struct calibrate_force_work *w,
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
		gather_calibrate_force(w, k, &up, &down);
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

/* --- refusals and outliers --- */

/* This near an end, as a share of the converter's range, noise is cut off: 10 mV of 5 V. */
#define MARGIN 0.002
/* Readings are alike within this share of all that was read. */
#define ALIKE 0.001
/* Readings of one load may scatter by this share of the largest load's reading. */
#define SCATTER_MAX 0.02
/* Outliers that are tolerated, as a share of the pairs. */
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

static int check_calibrate_force_setup(const struct incise_calibrate_force_setup *s,
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
			      "scale, range and tolerance must be positive");
}

static bool near(double ratio, double expected)
{
	return ratio > 0.7 * expected && ratio < 1.4 * expected;
}

/*
 * Name the mistake behind a slope that is off by a known factor. Columns are swapped where the
 * inverse of the slope, with loads in the unit of the column, is the nominal sensitivity.
 */
static int check_slope(const struct calibrate_force_work *w, double slope,
		       struct incise_error *err)
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
		sign = "the reading does not increase with the load; check the wiring "
		       "of the sensor";
	return sign ? incise_error_set(err, EDOM,
				       "a slope of %.4g mV/N is not plausible; "
				       "expected about %.4g: %s",
				       slope, nominal, sign)
		    : 0;
}

/*
 * The reading that all loads from one on (@top: upwards) share, though they are clearly apart;
 * NAN: none. A wrongly noted weight makes none: other pairs of its load read otherwise.
 */
static double plateau(const struct calibrate_force_work *w, bool top)
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

/* Mark saturated pairs; returns their number. */
static int mark_saturated(struct calibrate_force_work *w)
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
static int count_loads(struct calibrate_force_work *w)
{
	gather_loads(w);
	return w->n_loads;
}

static int check_loads(struct calibrate_force_work *w, struct incise_error *err)
{
	int loads = count_loads(w), used = 0;

	for (int i = 0; i < w->n; i++)
		used += w->states[i] == INCISE_CALIBRATE_FORCE_USED;
	if (loads >= 3 && used >= 5)
		return 0;
	if (used < w->n)
		return incise_error_set(
			err, ENODATA,
			"%d pairs are saturated or outliers; the remaining %d pairs of "
			"%d different loads are too few, at least 5 of 3 are required; "
			"use smaller weights",
			w->n - used, used, loads);
	if (loads == 1)
		return incise_error_set(
			err, ENODATA,
			"all %d pairs have the same load, which gives no slope; use 5 "
			"loads or more",
			used);
	return incise_error_set(err, ENODATA,
				"%d pairs of %d different loads: expected at least 5 "
				"pairs of 3 loads; 5 loads in 3 series are recommended",
				used, loads);
}

static int mark_outliers(struct calibrate_force_work *w, struct incise_error *err)
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
		/* A distance that rounding by scale and converter explains is no outlier. */
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
						      : "no line fits %d pairs",
					w->n);
	w->robust_slope = line.slope;
	if (found > OUTLIERS_MAX * m)
		return incise_error_set(
			err, EDOM,
			"%d of %d pairs are outliers, more than one in ten; repeat the "
			"calibration (the report lists them)",
			found, m);
	return 0;
}

/* Mistakes are named before pairs are left out: by the slope of all readings. */
static int check_whole(struct calibrate_force_work *w, struct incise_error *err)
{
	bool *outlier = malloc(w->n * sizeof(*outlier));
	struct robust_line line;
	int rc = outlier ? incise_robust_line(w->F, w->y, w->n, 0, &line, outlier)
			 : -ENOMEM;

	free(outlier);
	if (rc == -ENOMEM)
		return incise_error_set(err, ENOMEM, "no memory for %d pairs", w->n);
	/* No line: check_loads() says why. A falling reading may be a saturated one. */
	return rc || !(line.slope > 0) ? 0 : check_slope(w, line.slope, err);
}

static int fit(struct calibrate_force_work *w, struct incise_calibrate_force *result,
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
	fit_calibrate_force_line(w, result);
	if (result->residual_sd_mV >
	    SCATTER_MAX * result->sensitivity_mV_N * w->loads[w->n_loads - 1].F_N)
		return incise_error_set(
			err, EDOM,
			"the readings scatter by %.3g mV about their line, more than "
			"%g %% of full scale; wait until each is steady, and check the "
			"loads",
			result->residual_sd_mV, 100 * SCATTER_MAX);
	measure_metrics(w, result);
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
	struct calibrate_force_work w = {.pairs = pairs, .n = n, .setup = setup};
	int rc = check_calibrate_force_setup(setup, err);

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

double incise_calibrate_gravity(double latitude_deg, double altitude_m)
{
	const double a_m = 6378137, f = 1 / 298.257223563, m = 0.00344978650684;
	const double sine = sin(latitude_deg * (M_PI / 180)), s2 = sine * sine;
	const double h = altitude_m / a_m;
	double ground = 9.7803253359 * (1 + 0.00193185265241 * s2) /
			sqrt(1 - 0.00669437999014 * s2);

	return ground * (1 - 2 * (1 + f + m - 2 * f * s2) * h + 3 * h * h);
}
