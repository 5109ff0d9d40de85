// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The weighted straight line of the force calibration and its budget of uncertainty.
 *
 * The readings of a load share the error of the weight, which more readings do not take away:
 * the variance of a load's mean is scatter²/n + (S u_load)², and its inverse the weight. The
 * slope is then S = Σ c_k mean_k, and each source adds by these c_k (GUM, JCGM 100:2008, 5.1.2).
 *
 * A part of one noun: tests/unit/calib/force.c tests it through its door.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "force_work.h"

static int by_force(const void *a, const void *b)
{
	double x = ((const struct load *)a)->F_N, y = ((const struct load *)b)->F_N;

	return (x > y) - (x < y);
}

void incise_calibrate_force_loads(struct work *w)
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

/* What chi² exceeds in 1 of 100, by Wilson and Hilferty. */
static double chi2_99(int freedom)
{
	double h = 2.0 / (9 * freedom);

	return freedom * pow(1 - h + 2.326348 * sqrt(h), 3);
}

/* The scatter of readings of one load, pooled; without repetition that about a line. */
static void measure_scatter(const struct work *w, struct incise_calibrate_force *result)
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

/* What is common to all readings of a load, mV: weight, and a code without noise. */
static double common_mV(const struct work *w, const struct load *load, double slope,
			double code_u_mV)
{
	return hypot(load->F_N > 0 ? slope * w->load_u_N : 0, code_u_mV);
}

static void add_part(struct incise_calibrate_force *result, const char *source, char type,
		     double u, const char *unit, double u_mV_N)
{
	struct incise_calibrate_force_part *part = &result->part[result->parts++];

	snprintf(part->source, sizeof(part->source), "%s", source);
	snprintf(part->unit, sizeof(part->unit), "%s", unit);
	part->type = type;
	part->u = u;
	part->u_mV_N = u_mV_N;
	part->sensitivity = u > 0 ? u_mV_N / u : 0;
}

/* Sources that turn all loads alike. */
static void add_common(const struct work *w, struct incise_calibrate_force *result)
{
	const struct incise_calibrate_force_setup *s = w->setup;
	const double S = result->sensitivity_mV_N;

	if (!w->masses)
		return;
	add_part(result, "gravity", 'B', s->gravity_u_m_s2, "m/s2",
		 S * s->gravity_u_m_s2 / s->gravity_m_s2);
	add_part(result, "density of air", 'B', s->air_u_kg_m3, "kg/m3",
		 S * s->air_u_kg_m3 / s->weight_kg_m3);
	add_part(result, "density of the weights", 'B', s->weight_u_kg_m3, "kg/m3",
		 S * s->air_kg_m3 * s->weight_u_kg_m3 /
			 (s->weight_kg_m3 * s->weight_kg_m3));
}

void incise_calibrate_force_line(struct work *w, struct incise_calibrate_force *result)
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
	/* The weights hold the slope; it is known so well that two rounds settle it. */
	for (int round = 0; round < 3; round++) {
		double sxy = 0;

		sw = mx = my = sxx = 0;
		for (int pass = 0; pass < 2; pass++)
			for (int k = 0; k < w->n_loads; k++) {
				const struct load *load = &w->loads[k];
				double own2 = result->scatter_sd_mV *
					      result->scatter_sd_mV / load->n;
				double common = common_mV(w, load, slope, code_u_mV);
				/* data without any scatter weigh alike */
				double weight = 1 / (own2 + common * common + 1e-12);

				if (!pass) {
					sw += weight;
					mx += weight * load->F_N;
					my += weight * load->mean_mV;
				} else {
					sxx += weight * (load->F_N - mx) *
					       (load->F_N - mx);
					sxy += weight * (load->F_N - mx) *
					       (load->mean_mV - my);
				}
				if (!pass && k == w->n_loads - 1) {
					mx /= sw;
					my /= sw;
				}
			}
		slope = sxy / sxx;
		zero = my - slope * mx;
	}
	for (int k = 0; k < w->n_loads; k++) {
		const struct load *load = &w->loads[k];
		double own2 = result->scatter_sd_mV * result->scatter_sd_mV / load->n;
		double common = common_mV(w, load, slope, code_u_mV);
		double weight = 1 / (own2 + common * common + 1e-12);
		double c = weight * (load->F_N - mx) / sxx;
		double r = load->mean_mV - zero - slope * load->F_N;

		chi2 += weight * r * r;
		scatter2 += c * c * own2;
		code2 += c * c * code_u_mV * code_u_mV;
		scale2 += c * c * (common * common - code_u_mV * code_u_mV);
	}
	result->loads = w->n_loads;
	result->sensitivity_mV_N = slope;
	result->zero_mV = zero;
	result->misfit = 1;
	if (w->n_loads > 2 && chi2 > chi2_99(w->n_loads - 2))
		result->misfit = sqrt(chi2 / (w->n_loads - 2));
	scatter2 *= turn * turn * result->misfit * result->misfit;
	scale2 = fmax(scale2, 0) * result->misfit * result->misfit;
	add_part(result, "scatter of readings", 'A', result->scatter_sd_mV, "mV",
		 sqrt(scatter2));
	add_part(result, "resolution of the scale", 'B', w->load_u_N, "N", sqrt(scale2));
	if (code_u_mV > 0)
		add_part(result, "resolution of the converter", 'B', code_u_mV, "mV",
			 sqrt(code2));
	add_common(w, result);
	for (int i = 0; i < result->parts; i++)
		u2 += result->part[i].u_mV_N * result->part[i].u_mV_N;
	result->sensitivity_u_mV_N = sqrt(u2);
	/* Of the line alone: what turns all loads does not move the zero. */
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
