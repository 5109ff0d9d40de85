// SPDX-License-Identifier: LGPL-2.1-or-later
/* The least squares of all pairs; see design.h. */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "design.h"

int incise_design_init(struct incise_design *design, const struct incise_model *model,
		       double min, double max)
{
	const struct incise_model_info *info = incise_model_info(model);
	int d = info->n_inputs, rc, exponent;

	memset(design, 0, sizeof(*design));
	rc = incise_basis_init(&design->basis, model);
	if (rc)
		return rc;
	design->scaling.n_inputs = d;
	for (int i = 0; i < d; i++) {
		design->scaling.offset[i] = info->input[i].min;
		design->scaling.scale[i] = info->input[i].max - info->input[i].min;
	}
	/* A power of two: t is not rounded a second time. */
	design->scaling.offset[d] = min / 2 + max / 2;
	frexp(max / 2 - min / 2, &exponent);
	design->scaling.scale[d] =
		max > min ? ldexp(1, exponent < -1000 ? -1000 : exponent) : 1;
	incise_scaling_premises(&design->scaling, &design->basis, false);
	design->gram = incise_gram_new(info->n_rules * (d + 1) + 2);
	return design->gram ? 0 : -ENOMEM;
}

void incise_design_free(struct incise_design *design)
{
	incise_gram_free(design->gram);
	design->gram = NULL;
}

int incise_design_add_to(struct incise_design *design, struct incise_gram *gram,
			 const double *raw, double weight)
{
	double w[INCISE_MODEL_RULES_MAX], x[INCISE_MODEL_INPUTS_MAX + 1];
	double *row = incise_gram_row(gram);
	int d = design->basis.n_inputs, n_rules = design->basis.n_rules, rc;
	int n = n_rules * (d + 1);

	incise_scaling_row(&design->scaling, raw, x);
	incise_basis_firing(&design->basis, x, w);
	incise_basis_row(&design->basis, w, x, row);
	row[n] = 1;
	row[n + 1] = x[d];
	if (weight != 1)
		for (int i = 0; i < n + 2; i++)
			row[i] *= sqrt(weight);
	rc = incise_gram_add(gram);
	for (int r = 0; r < n_rules && !rc; r++)
		design->largest[r] = fmax(design->largest[r], w[r]);
	return rc;
}

void incise_design_target(const struct incise_design *design, struct incise_gram *gram,
			  struct incise_scaling *scaling, double *mean, double *scale)
{
	int d = design->scaling.n_inputs;
	double middle = design->scaling.offset[d], unit = design->scaling.scale[d];

	*scaling = design->scaling;
	incise_gram_target(gram, mean, scale);
	scaling->offset[d] = middle + *mean * unit;
	/* A constant, whatever the rounding of its elements leaves of a deviation. */
	if (!(*scale * unit > 1e-14 * (fabs(scaling->offset[d]) + unit)))
		*scale = fabs(scaling->offset[d]) > 0 ? fabs(scaling->offset[d]) / unit
						      : 1;
	scaling->scale[d] = *scale * unit;
}
