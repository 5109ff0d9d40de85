// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a model in double to one in integers; see incise/fixed.h and lib/fixed/fuzzy.c for
 * the formats. They are chosen such that no input within the support can overflow; a
 * model that no choice holds is refused.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <incise/fixed.h>
#include "model.h"

/* Largest magnitude of an input: Q16.16 in 32 bits. */
#define X_MAX 32767.0

/* Least k with 2^k ≥ v. */
static int bits(double v)
{
	int e;
	double m = frexp(v, &e);

	return v <= 0 ? -1000 : m == 0.5 ? e - 1 : e;
}

static int32_t to_q16(double x)
{
	return (int32_t)lrint(x * INCISE_FIXED_ONE);
}

static int check_shape(const struct incise_model *model, struct incise_error *err)
{
	int n_rules = 1;

	if (model->n_inputs > INCISE_FIXED_INPUTS_MAX)
		return incise_error_set(
			err, E2BIG,
			"fixed point: the model has %d inputs, at most %d fit",
			model->n_inputs, INCISE_FIXED_INPUTS_MAX);
	if (model->and_method != INCISE_AND_PROD)
		return incise_error_set(err, ENOTSUP,
					"fixed point: the model's AndMethod is min, only "
					"prod has a fixed form; use double");
	for (int i = 0; i < model->n_inputs; i++) {
		if (model->n_mfs[i] > INCISE_FIXED_MFS_MAX)
			return incise_error_set(
				err, E2BIG,
				"fixed point: input %s has %d membership functions, at "
				"most %d fit",
				model->input[i].name, model->n_mfs[i],
				INCISE_FIXED_MFS_MAX);
		n_rules *= model->n_mfs[i];
		for (int k = 0; k < model->n_mfs[i]; k++)
			if (model->mf[i][k].type != INCISE_MF_GAUSS)
				return incise_error_set(
					err, ENOTSUP,
					"fixed point: input %s, function %s is a %s, only "
					"gaussmf has a fixed form; train with --mf-type "
					"gaussmf or use double",
					model->input[i].name, model->mf[i][k].name,
					incise_mf_type_name(model->mf[i][k].type));
	}
	if (n_rules > INCISE_FIXED_RULES_MAX)
		return incise_error_set(
			err, E2BIG, "fixed point: the model has %d rules, at most %d fit",
			n_rules, INCISE_FIXED_RULES_MAX);
	if (model->n_rules != n_rules)
		return incise_error_set(
			err, ENOTSUP,
			"fixed point: the model has %d rules, its grid has "
			"%d: only full grids have a fixed form; use double",
			model->n_rules, n_rules);
	return 0;
}

static int compile_mf(const struct incise_variable *in, const struct incise_mf *mf,
		      struct incise_fixed_mf *fx, struct incise_error *err)
{
	/* exp(-(x-c)²/(2s²)) = 2^-((x-c)·k)² */
	double k = 1 / (mf->p[0] * sqrt(2 * M_LN2));
	double scaled = k * 256; /* Q16 in, Q24 out */
	int shift = 30 - bits(nextafter(scaled, INFINITY));
	double lost;

	if (fabs(mf->p[1]) > X_MAX)
		return incise_error_set(
			err, ERANGE,
			"fixed point: input %s, function %s: its centre %g is "
			"beyond ±%g; use double",
			in->name, mf->name, mf->p[1], X_MAX);
	if (shift < 0)
		return incise_error_set(
			err, ERANGE,
			"fixed point: input %s, function %s: its width %g is too "
			"small for a format; use double",
			in->name, mf->name, mf->p[0]);
	fx->centre = to_q16(mf->p[1]);
	/* So wide that it is flat: 2^-32 of a width is less than an LSB of the result. */
	fx->slope = shift > 62 ? 0 : (int32_t)fmin(lrint(ldexp(scaled, shift)), 1 << 30);
	fx->shift = shift > 62 ? 62 : shift;
	/* The rounding of the centre would act like one of the input: as much as 30 µN. */
	lost = mf->p[1] - fx->centre / (double)INCISE_FIXED_ONE;
	fx->offset = (int32_t)lrint(ldexp(fmin(lost * k, 127), 24));
	return 0;
}

/*
 * Distances are held at 128 widths. Between two functions that are both further away the
 * nearer one could not be told: the largest such distance is where neighbours cross, or
 * at the ends of the support.
 */
static int check_cover(const struct incise_model *model, int i, struct incise_error *err)
{
	const struct incise_variable *in = &model->input[i];
	double points[2 + INCISE_MODEL_MFS_MAX * INCISE_MODEL_MFS_MAX];
	int n = 0;

	points[n++] = in->min;
	points[n++] = in->max;
	for (int a = 0; a < model->n_mfs[i]; a++)
		for (int b = 0; b < a; b++) {
			const double *p = model->mf[i][a].p, *q = model->mf[i][b].p;
			double x = (p[1] * q[0] + q[1] * p[0]) / (p[0] + q[0]);

			if (x > in->min && x < in->max)
				points[n++] = x;
		}
	for (int j = 0; j < n; j++) {
		double least = INFINITY;

		for (int k = 0; k < model->n_mfs[i]; k++) {
			const double *p = model->mf[i][k].p;

			least = fmin(least,
				     fabs(points[j] - p[1]) / (p[0] * sqrt(2 * M_LN2)));
		}
		if (least > 127)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s: no membership function "
				"is within 150 widths of %g; use double",
				in->name, points[j]);
	}
	return 0;
}

/* Formats of the consequents: the largest that cannot overflow, see lib/fixed/fuzzy.c. */
static int compile_rules(const struct incise_model *model, struct incise_fixed *fx,
			 struct incise_error *err)
{
	double acc = 0, y = 0;

	for (int r = 0; r < model->n_rules; r++) {
		const double *p = model->rule[r].p;
		double a = fabs(p[0]), mid = p[0], half = 0;

		for (int i = 0; i < model->n_inputs; i++) {
			const struct incise_variable *in = &model->input[i];

			a += fabs(p[i + 1]) * fmax(fabs(in->min), fabs(in->max));
			mid += p[i + 1] * (in->min + in->max) / 2;
			half += fabs(p[i + 1]) * (in->max - in->min) / 2;
		}
		acc = fmax(acc, a);
		y = fmax(y, fabs(mid) + half);
	}
	/* p·x adds up in Q(p_shift+16), Σ w·y in Q(y_shift+30); one bit to spare in each. */
	fx->p_shift = (int)fmin(30, 62 - 17 - bits(acc));
	fx->y_shift = (int)fmin(26, 62 - 30 - bits(model->n_rules) - bits(y));
	if (fx->y_shift < 17 || fx->p_shift + 16 < fx->y_shift || fx->p_shift < 1)
		return incise_error_set(
			err, ERANGE,
			"fixed point: rules reach %.3g (%.3g before "
			"cancellation): too large for a format; train with more "
			"ridge, or use double",
			y, acc);
	for (int r = 0; r < model->n_rules; r++) {
		int grid = 0;

		for (int i = 0; i < model->n_inputs; i++)
			grid = grid * model->n_mfs[i] + model->rule[r].mf[i];
		if (model->rule[r].weight != 1 || grid != r)
			return incise_error_set(
				err, ENOTSUP,
				"fixed point: rule %d has a weight, or is out of "
				"the grid's order (last input fastest); use "
				"double",
				r + 1);
		for (int i = 0; i <= model->n_inputs; i++)
			fx->p[r][i] = llrint(ldexp(model->rule[r].p[i], fx->p_shift));
	}
	return 0;
}

int incise_fixed_compile(const struct incise_model *model, struct incise_fixed *fx,
			 struct incise_error *err)
{
	int rc = check_shape(model, err);

	memset(fx, 0, sizeof(*fx));
	if (rc)
		return rc;
	fx->n_inputs = model->n_inputs;
	fx->n_rules = model->n_rules;
	for (int i = 0; i < model->n_inputs; i++) {
		const struct incise_variable *in = &model->input[i];

		if (fmax(fabs(in->min), fabs(in->max)) > X_MAX ||
		    in->max - in->min < 64.0 / INCISE_FIXED_ONE)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s: its support %g to %g is "
				"beyond ±%g or narrower than 0.001; use double",
				in->name, in->min, in->max, X_MAX);
		fx->input[i].min = to_q16(in->min);
		fx->input[i].max = to_q16(in->max);
		fx->input[i].n_mfs = model->n_mfs[i];
		for (int k = 0; k < model->n_mfs[i]; k++) {
			rc = compile_mf(in, &model->mf[i][k], &fx->input[i].mf[k], err);
			if (rc)
				return rc;
		}
		rc = check_cover(model, i, err);
		if (rc)
			return rc;
	}
	return compile_rules(model, fx, err);
}

double incise_fixed_eval_double(const struct incise_fixed *fx, const double *x)
{
	int32_t in[INCISE_FIXED_INPUTS_MAX];

	for (int i = 0; i < fx->n_inputs; i++) {
		if (isnan(x[i]))
			in[i] = (int32_t)(((int64_t)fx->input[i].min + fx->input[i].max) /
					  2);
		else
			in[i] = to_q16(fmax(-X_MAX, fmin(X_MAX, x[i])));
	}
	return incise_fixed_eval(fx, in) / (double)INCISE_FIXED_ONE;
}
