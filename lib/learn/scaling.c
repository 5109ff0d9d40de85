// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Units for learning; see scaling.h.
 */
#include <errno.h>
#include <math.h>
#include "scaling.h"

void incise_scaling_find(struct incise_scaling *scaling,
			 const struct incise_variable *inputs,
			 const struct incise_pairs *pairs)
{
	int d = pairs->n_inputs;
	double mean = 0, sum = 0, largest = 0;

	scaling->n_inputs = d;
	for (int i = 0; i < d; i++) {
		scaling->offset[i] = inputs[i].min;
		scaling->scale[i] = inputs[i].max - inputs[i].min;
	}
	for (size_t n = 0; n < pairs->n; n++)
		largest = fmax(largest, fabs(pairs->rows[n * (d + 1) + d]));
	if (!(largest > 0))
		largest = 1;
	/* Relative to the largest, so that squares neither vanish nor overflow. */
	for (size_t n = 0; n < pairs->n; n++)
		mean += pairs->rows[n * (d + 1) + d] / largest / pairs->n;
	for (size_t n = 0; n < pairs->n; n++) {
		double e = pairs->rows[n * (d + 1) + d] / largest - mean;

		sum += e * e / pairs->n;
	}
	scaling->offset[d] = mean * largest;
	/* Of a constant, rounding leaves a spread of its own: that is not a scale. */
	scaling->scale[d] = sum > 1e-28 ? sqrt(sum) * largest : largest;
}

void incise_scaling_row(const struct incise_scaling *scaling, const double *raw,
			double *scaled)
{
	for (int i = 0; i <= scaling->n_inputs; i++)
		scaled[i] = (raw[i] - scaling->offset[i]) / scaling->scale[i];
}

void incise_scaling_premises(const struct incise_scaling *scaling,
			     struct incise_basis *basis, bool to_raw)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			/* Width and centre of both kinds are lengths, a slope is not. */
			double *width = basis->p + basis->at[i][k];
			double *centre = basis->p + incise_basis_centre(basis, i, k);

			if (to_raw) {
				*width *= scaling->scale[i];
				*centre =
					scaling->offset[i] + *centre * scaling->scale[i];
			} else {
				*width /= scaling->scale[i];
				*centre = (*centre - scaling->offset[i]) /
					  scaling->scale[i];
			}
		}
}

int incise_scaling_consequents(const struct incise_scaling *scaling, int n_rules,
			       double *consequents)
{
	int d = scaling->n_inputs;

	for (int r = 0; r < n_rules; r++) {
		double *p = consequents + r * (d + 1);

		p[0] = scaling->offset[d] + p[0] * scaling->scale[d];
		for (int i = 0; i < d; i++) {
			p[i + 1] = p[i + 1] / scaling->scale[i] * scaling->scale[d];
			p[0] -= p[i + 1] * scaling->offset[i];
		}
		for (int i = 0; i <= d; i++)
			if (!isfinite(p[i]))
				return -EDOM;
	}
	return 0;
}
