// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The Takagi–Sugeno model in double: making, reading out and evaluating it; see
 * incise/model.h.
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

/* Evenly spaced functions over the range, neighbours crossing at 0.5 (MATLAB's genfis1). */
static void grid_mf(struct incise_mf *mf, enum incise_mf_type type,
		    const struct incise_variable *input, int index, int k, int n)
{
	double range = input->max - input->min;
	double half = n > 1 ? range / (n - 1) / 2 : range / 2;
	double centre = n > 1 ? input->min + range * k / (n - 1) : input->min + range / 2;

	mf->type = type;
	snprintf(mf->name, sizeof(mf->name), "in%dmf%d", index + 1, k + 1);
	switch (type) {
	case INCISE_MF_GAUSS:
		mf->p[0] = half / sqrt(2 * M_LN2);
		mf->p[1] = centre;
		break;
	case INCISE_MF_GBELL:
		mf->p[0] = half;
		mf->p[1] = 2;
		mf->p[2] = centre;
		break;
	}
}

static void grid_rules(struct incise_model *model)
{
	for (int r = 0; r < model->n_rules; r++) {
		int rest = r;

		model->rule[r].weight = 1;
		for (int i = model->n_inputs - 1; i >= 0; i--) {
			model->rule[r].mf[i] = rest % model->n_mfs[i];
			rest /= model->n_mfs[i];
		}
	}
}

struct incise_model *incise_model_new_grid(int n_inputs,
					   const struct incise_variable *inputs,
					   const int *n_mfs, enum incise_mf_type type,
					   const struct incise_variable *output,
					   struct incise_error *err)
{
	struct incise_model *model;
	int n_rules = 1;

	if (n_inputs < 1 || n_inputs > INCISE_MODEL_INPUTS_MAX) {
		incise_error_set(err, EINVAL, "%d inputs: a model has 1 to %d", n_inputs,
				 INCISE_MODEL_INPUTS_MAX);
		return NULL;
	}
	for (int i = 0; i < n_inputs; i++) {
		const struct incise_variable *in = &inputs[i];

		if (!isfinite(in->max - in->min) || !(in->min < in->max)) {
			incise_error_set(
				err, EINVAL,
				"input %s: its range is %g to %g: it must be finite "
				"and not empty; is the column constant?",
				in->name, in->min, in->max);
			return NULL;
		}
		if (n_mfs[i] < 1 || n_mfs[i] > INCISE_MODEL_MFS_MAX) {
			incise_error_set(
				err, EINVAL,
				"input %s: %d membership functions: it can have 1 to %d",
				in->name, n_mfs[i], INCISE_MODEL_MFS_MAX);
			return NULL;
		}
		n_rules *= n_mfs[i];
		if (n_rules > INCISE_MODEL_RULES_MAX) {
			incise_error_set(
				err, E2BIG,
				"the grid has %d rules or more: at most %d; ask for "
				"fewer membership functions",
				n_rules, INCISE_MODEL_RULES_MAX);
			return NULL;
		}
	}
	model = calloc(1, sizeof(*model));
	if (!model) {
		incise_error_set(err, ENOMEM, "no memory for a model");
		return NULL;
	}
	snprintf(model->name, sizeof(model->name), "incise");
	model->n_inputs = n_inputs;
	model->n_rules = n_rules;
	model->clamp = true;
	model->output = *output;
	for (int i = 0; i < n_inputs; i++) {
		model->input[i] = inputs[i];
		model->n_mfs[i] = n_mfs[i];
		for (int k = 0; k < n_mfs[i]; k++)
			grid_mf(&model->mf[i][k], type, &inputs[i], i, k, n_mfs[i]);
	}
	grid_rules(model);
	return model;
}

struct incise_model *incise_model_copy(const struct incise_model *model)
{
	struct incise_model *copy = malloc(sizeof(*copy));

	if (copy)
		*copy = *model;
	return copy;
}

void incise_model_assign(struct incise_model *to, const struct incise_model *from)
{
	*to = *from;
}

void incise_model_free(struct incise_model *model)
{
	free(model);
}

const char *incise_model_name(const struct incise_model *model)
{
	return model->name;
}

void incise_model_set_name(struct incise_model *model, const char *name)
{
	snprintf(model->name, sizeof(model->name), "%s", name);
}

int incise_model_n_inputs(const struct incise_model *model)
{
	return model->n_inputs;
}

int incise_model_n_rules(const struct incise_model *model)
{
	return model->n_rules;
}

int incise_model_n_mfs(const struct incise_model *model, int input)
{
	return model->n_mfs[input];
}

const struct incise_variable *incise_model_input(const struct incise_model *model,
						 int input)
{
	return &model->input[input];
}

const struct incise_variable *incise_model_output(const struct incise_model *model)
{
	return &model->output;
}

const struct incise_mf *incise_model_mf(const struct incise_model *model, int input,
					int mf)
{
	return &model->mf[input][mf];
}

int incise_model_set_mf(struct incise_model *model, int input, int mf, const double p[4])
{
	struct incise_mf *f = &model->mf[input][mf];

	if (!incise_mf_valid(f->type, p))
		return -EINVAL;
	memcpy(f->p, p, incise_mf_n_params(f->type) * sizeof(*p));
	return 0;
}

int incise_model_rule_mf(const struct incise_model *model, int rule, int input)
{
	return model->rule[rule].mf[input];
}

const double *incise_model_consequent(const struct incise_model *model, int rule)
{
	return model->rule[rule].p;
}

int incise_model_set_consequent(struct incise_model *model, int rule, const double *p)
{
	for (int i = 0; i <= model->n_inputs; i++)
		if (!isfinite(p[i]))
			return -EINVAL;
	memcpy(model->rule[rule].p, p, (model->n_inputs + 1) * sizeof(*p));
	for (int i = 1; i <= model->n_inputs; i++)
		model->rule[rule].constant &= p[i] == 0;
	return 0;
}

void incise_model_set_clamp(struct incise_model *model, bool clamp)
{
	model->clamp = clamp;
}

void incise_model_firing(const struct incise_model *model, const double *x, double *w)
{
	double logs[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	double largest = -INFINITY;
	double sum = 0;

	for (int i = 0; i < model->n_inputs; i++)
		for (int k = 0; k < model->n_mfs[i]; k++)
			logs[i][k] = incise_mf_log(&model->mf[i][k], x[i]);
	for (int r = 0; r < model->n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		w[r] = log(rule->weight);
		for (int i = 0; i < model->n_inputs; i++)
			if (rule->mf[i] >= 0)
				w[r] += logs[i][rule->mf[i]];
		largest = fmax(largest, w[r]);
	}
	for (int r = 0; r < model->n_rules; r++) {
		w[r] = exp(w[r] - largest);
		sum += w[r];
	}
	/* The largest is exp(0): sum ≥ 1. */
	for (int r = 0; r < model->n_rules; r++)
		w[r] /= sum;
}

double incise_model_eval(const struct incise_model *model, const double *x,
			 unsigned int *flags)
{
	double in[INCISE_MODEL_INPUTS_MAX];
	double w[INCISE_MODEL_RULES_MAX];
	unsigned int seen = 0;
	double y = 0;

	for (int i = 0; i < model->n_inputs; i++) {
		const struct incise_variable *v = &model->input[i];

		in[i] = x[i];
		if (x[i] >= v->min && x[i] <= v->max)
			continue;
		seen |= INCISE_MODEL_EXTRAPOLATED;
		if (isnan(x[i]))
			in[i] = v->min + (v->max - v->min) / 2;
		else if (model->clamp)
			in[i] = x[i] < v->min ? v->min : v->max;
		else
			in[i] = fmax(-DBL_MAX, fmin(DBL_MAX, x[i]));
	}
	incise_model_firing(model, in, w);
	for (int r = 0; r < model->n_rules; r++) {
		const double *p = model->rule[r].p;
		double yr = p[0];

		for (int i = 0; i < model->n_inputs; i++)
			yr += p[i + 1] * in[i];
		/* A rule that does not fire has no say, not even with an overflow. */
		if (w[r] > 0)
			y += w[r] * yr;
	}
	if (flags)
		*flags = seen;
	/* Only linear extrapolation can overflow, and then there is no right answer. */
	if (isnan(y))
		return 0;
	return fmax(-DBL_MAX, fmin(DBL_MAX, y));
}
