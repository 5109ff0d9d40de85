// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Taking a model as a full grid of Gaussians; see grid.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "grid.h"
#include "model.h"

/* Largest magnitude of an input: Q16.16 in 32 bits, ranges too. */
#define X_MAX 16383.0

static int check_input(const struct incise_model *model, int i, struct incise_error *err)
{
	const struct incise_variable *v = incise_model_input(model, i);
	int n = incise_model_n_mfs(model, i);

	if (n > INCISE_FIXED_MFS_MAX)
		return incise_error_set(
			err, E2BIG,
			"fixed point: input %s has %d membership functions, at "
			"most %d fit; use double",
			v->name, n, INCISE_FIXED_MFS_MAX);
	if (fmax(fabs(v->min), fabs(v->max)) > X_MAX ||
	    v->max - v->min < 64.0 / INCISE_FIXED_ONE)
		return incise_error_set(
			err, ERANGE,
			"fixed point: input %s: its support %g to %g is beyond "
			"±%g or narrower than 0.001; use double",
			v->name, v->min, v->max, X_MAX);
	for (int k = 0; k < n; k++) {
		const struct incise_mf *mf = incise_model_mf(model, i, k);

		if (mf->type != INCISE_MF_GAUSS)
			return incise_error_set(
				err, ENOTSUP,
				"fixed point: input %s, function %s is a %s, only gaussmf has "
				"a fixed form; train with --mf-type gaussmf or use double",
				v->name, mf->name, incise_mf_type_name(mf->type));
		if (fabs(mf->p[1]) > X_MAX)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s, function %s: its centre %g is beyond "
				"±%g; use double",
				v->name, mf->name, mf->p[1], X_MAX);
		/* 2^-22 of a unit: some LSB of the input, below which there is no shape. */
		if (mf->p[0] < 64.0 / INCISE_FIXED_ONE / INCISE_FIXED_ONE)
			return incise_error_set(
				err, ERANGE,
				"fixed point: input %s, function %s: its width %g is too small "
				"for a format; use double",
				v->name, mf->name, mf->p[0]);
	}
	return 0;
}

int incise_grid_init(struct incise_grid *grid, const struct incise_model *model,
		     struct incise_error *err)
{
	int n = incise_model_n_inputs(model), n_rules = incise_model_n_rules(model);
	int n_b = incise_model_n_mfs(model, n - 1), grid_rules = 1, rc;

	memset(grid, 0, sizeof(*grid));
	if (n > INCISE_FIXED_INPUTS_MAX)
		return incise_error_set(
			err, E2BIG,
			"fixed point: the model has %d inputs, at most %d fit; "
			"use double",
			n, INCISE_FIXED_INPUTS_MAX);
	if (model->and_method != INCISE_AND_PROD)
		return incise_error_set(
			err, ENOTSUP,
			"fixed point: the model's AndMethod is min, only prod has a "
			"fixed form; use double");
	for (int i = 0; i < n; i++) {
		rc = check_input(model, i, err);
		if (rc)
			return rc;
		grid_rules *= incise_model_n_mfs(model, i);
	}
	if (grid_rules != n_rules)
		return incise_error_set(
			err, ENOTSUP,
			"fixed point: the model has %d rules, its grid has %d: "
			"only full grids have a fixed form; use double",
			n_rules, grid_rules);
	grid->one = n == 1;
	grid->a = (struct incise_axis){.n = 1, .s = {1}};
	if (n == 2)
		incise_axis_init(&grid->a, model, 0);
	incise_axis_init(&grid->b, model, n - 1);
	for (int r = 0; r < n_rules; r++) {
		const double *p = incise_model_consequent(model, r);
		double *to = grid->p[r / n_b][r % n_b];

		if (incise_model_rule_mf(model, r, n - 1) != r % n_b ||
		    (n == 2 && incise_model_rule_mf(model, r, 0) != r / n_b) ||
		    model->rule[r].weight != 1)
			return incise_error_set(
				err, ENOTSUP,
				"fixed point: rule %d has a weight, or is out "
				"of the grid's order (last input fastest); use "
				"double",
				r + 1);
		to[0] = p[0];
		to[1] = n == 2 ? p[1] : 0;
		to[2] = p[n];
	}
	return 0;
}

void incise_grid_size(const struct incise_grid *grid, struct incise_grid_size *size)
{
	const struct incise_axis *a = &grid->a, *b = &grid->b;

	*size = (struct incise_grid_size){0};
	for (int i = 0; i < a->n; i++)
		for (int j = 0; j < b->n; j++) {
			const double *p = grid->p[i][j];
			double middle = p[0] + p[1] * (a->min + a->max) / 2 +
					p[2] * (b->min + b->max) / 2;
			double half = fabs(p[1]) * (a->max - a->min) / 2 +
				      fabs(p[2]) * (b->max - b->min) / 2;
			double parts = fabs(p[0]) +
				       fabs(p[1]) * fmax(fabs(a->min), fabs(a->max)) +
				       fabs(p[2]) * fmax(fabs(b->min), fabs(b->max));

			size->rule = fmax(size->rule, fabs(middle) + half);
			size->parts = fmax(size->parts, parts);
			size->slope = fmax(size->slope, fabs(p[1]));
		}
}
