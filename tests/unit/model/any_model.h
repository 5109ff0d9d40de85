/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Models of any shape by seed, with all kinds of functions, free rule lists, weights and
 * both AND methods; and an evaluation of them in long double, straight from the formulas
 * in incise-fis(5). Its exponent reaches to 1e-4932, where doubles have long underflowed.
 */
#ifndef INCISE_TEST_ANY_MODEL_H
#define INCISE_TEST_ANY_MODEL_H

#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../../../lib/model/model.h"
#include "paper_model.h"

#define ANY_KINDS 6

static inline long double any_gauss(long double x, long double s, long double c)
{
	return expl(-(x - c) * (x - c) / (2 * s * s));
}

static inline long double any_trapezoid(long double x, long double a, long double b,
					long double c, long double d)
{
	long double rise, fall;

	if (x < a || x > d)
		return 0;
	rise = x < b ? (x - a) / (b - a) : 1;
	fall = x > c ? (d - x) / (d - c) : 1;
	return rise < fall ? rise : fall;
}

static inline long double any_degree(const struct incise_mf *mf, long double x)
{
	const double *p = mf->p;

	switch (mf->type) {
	case INCISE_MF_GAUSS:
		return any_gauss(x, p[0], p[1]);
	case INCISE_MF_GBELL:
		return 1 / (1 + powl(fabsl((x - p[2]) / p[0]), 2 * (long double)p[1]));
	case INCISE_MF_GAUSS2:
		return (x < p[1] ? any_gauss(x, p[0], p[1]) : 1) *
		       (x > p[3] ? any_gauss(x, p[2], p[3]) : 1);
	case INCISE_MF_TRI:
		if (x == p[1])
			return 1;
		if (x <= p[0] || x >= p[2])
			return 0;
		return x < p[1] ? (x - p[0]) / ((long double)p[1] - p[0])
				: (p[2] - x) / ((long double)p[2] - p[1]);
	case INCISE_MF_TRAP:
		return any_trapezoid(x, p[0], p[1], p[2], p[3]);
	case INCISE_MF_SIG:
		return 1 / (1 + expl(-(long double)p[0] * (x - p[1])));
	}
	return NAN;
}

/* Strengths of all rules, not normalised; returns the largest. */
static inline long double any_strengths(const struct incise_model *model, const double *x,
					long double *w)
{
	long double largest = 0;

	for (int r = 0; r < model->info.n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		w[r] = 1;
		for (int i = 0; i < model->info.n_inputs; i++) {
			long double degree;

			if (rule->mf[i] < 0)
				continue;
			degree = any_degree(&model->mf[i][rule->mf[i]], x[i]);
			if (model->info.and_method == INCISE_AND_PROD)
				w[r] *= degree;
			else if (degree < w[r])
				w[r] = degree;
		}
		w[r] *= rule->weight;
		if (w[r] > largest)
			largest = w[r];
	}
	return largest;
}

/* Eq. (3); NaN where nothing fires even here. */
static inline long double any_output(const struct incise_model *model, const double *x)
{
	long double w[INCISE_MODEL_RULES_MAX], sum = 0, weights = 0;

	any_strengths(model, x, w);
	for (int r = 0; r < model->info.n_rules; r++) {
		long double y = model->rule[r].p[0];

		for (int i = 0; i < model->info.n_inputs; i++)
			y += (long double)model->rule[r].p[i + 1] * x[i];
		sum += w[r] * y;
		weights += w[r];
	}
	return sum / weights;
}

/* A whole number from 0 to n-1. */
static inline int any_below(uint64_t *seed, int n)
{
	int v = (int)((paper_random(seed) + 1) / 2 * n);

	return v < n ? v : n - 1;
}

/* 10^-decades … 10^decades, evenly by logarithm. */
static inline double any_width(uint64_t *seed, double decades)
{
	return pow(10, decades * paper_random(seed));
}

/* A function within about ±10, upright edges and crossing slopes among them. */
static inline void any_mf(struct incise_mf *mf, uint64_t *seed, double decades)
{
	double c = 10 * paper_random(seed), s = any_width(seed, decades);
	double t = any_width(seed, decades);
	double *p = mf->p;

	mf->type = any_below(seed, ANY_KINDS);
	memset(p, 0, sizeof(mf->p));
	switch (mf->type) {
	case INCISE_MF_GAUSS:
		p[0] = s;
		p[1] = c;
		break;
	case INCISE_MF_GBELL:
		p[0] = s;
		p[1] = t;
		p[2] = c;
		break;
	case INCISE_MF_GAUSS2:
		p[0] = s;
		p[1] = c;
		p[2] = t;
		p[3] = c + s * paper_random(seed);
		break;
	case INCISE_MF_TRI:
		p[0] = any_below(seed, 5) ? c - s : c;
		p[1] = c;
		p[2] = any_below(seed, 5) ? c + t : c;
		break;
	case INCISE_MF_TRAP:
		p[1] = c;
		p[2] = any_below(seed, 5) ? c + s : c - 0.4 * fmin(s, t);
		p[0] = any_below(seed, 5) ? p[1] - s : p[1];
		p[3] = any_below(seed, 5) ? p[2] + t : p[2];
		/* A slope that crosses upright ones may leave nothing, or no order. */
		if (incise_mf_fault(mf->type, p))
			memcpy(p, (double[]){c - s, c, c, c + t}, sizeof(mf->p));
		break;
	case INCISE_MF_SIG:
		p[0] = any_below(seed, 10) ? (paper_random(seed) < 0 ? -s : s) : 0;
		p[1] = c;
		break;
	}
}

/*
 * Make @model again: n_inputs with ranges ±10, n_rules rules of which a part leave inputs
 * out, carry weights, or weigh nothing; widths over 10^±decades.
 */
static inline void any_model(struct incise_model *model, uint64_t *seed, int n_inputs,
			     int n_rules, double decades)
{
	snprintf(model->info.name, sizeof(model->info.name), "any");
	model->info.n_inputs = n_inputs;
	model->info.n_rules = n_rules;
	model->clamp = any_below(seed, 2);
	model->info.and_method = any_below(seed, 2) ? INCISE_AND_MIN : INCISE_AND_PROD;
	model->info.output = (struct incise_variable){"y", -1, 1};
	for (int i = 0; i < n_inputs; i++) {
		model->info.input[i] = (struct incise_variable){"x", -10, 10};
		model->info.n_mfs[i] = 1 + any_below(seed, 5);
		for (int k = 0; k < model->info.n_mfs[i]; k++)
			any_mf(&model->mf[i][k], seed, decades);
	}
	for (int r = 0; r < n_rules; r++) {
		struct incise_rule *rule = &model->rule[r];
		int weighs = any_below(seed, 6);

		for (int i = 0; i < n_inputs; i++)
			rule->mf[i] = any_below(seed, 8)
					      ? any_below(seed, model->info.n_mfs[i])
					      : -1;
		rule->weight = r == 0 || weighs > 1 ? 1
			       : weighs		    ? (1 + paper_random(seed)) / 2
						    : 0;
		model->constant[r] = !any_below(seed, 4);
		for (int i = 0; i <= n_inputs; i++)
			rule->p[i] = i && model->constant[r] ? 0 : paper_random(seed);
	}
	incise_model_classify(model);
}

#endif
