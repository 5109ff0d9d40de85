// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Bounds and steps of membership functions; see premises.h.
 */
#include <math.h>
#include "premises.h"
#include "shuffle.h"

#define LEAST_GAP 0.25 /* between centres, in even spacings */
#define LEAST_OVERLAP 0.1
#define MOST_WIDTH 4.0 /* in widths of the even grid */
#define JITTER 0.3

static double spacing(const struct incise_basis *basis, int input)
{
	int n = basis->n_mfs[input];

	return n > 1 ? 1.0 / (n - 1) : 1.0;
}

void incise_premises_scale(const struct incise_basis *basis, double *scale)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			int at = basis->at[i][k], c = incise_basis_centre(basis, i, k);

			for (int j = at; j < c; j++)
				scale[j] = basis->p[j];
			scale[c] = spacing(basis, i);
		}
}

static double clamp(double x, double min, double max)
{
	return fmax(min, fmin(max, x));
}

static void order_centres(struct incise_basis *basis, int input)
{
	int n = basis->n_mfs[input];
	double gap = LEAST_GAP * spacing(basis, input), bound = 0;

	for (int k = 0; k < n; k++) {
		double *c = &basis->p[incise_basis_centre(basis, input, k)];

		*c = fmax(*c, bound);
		bound = *c + gap;
	}
	bound = 1;
	for (int k = n - 1; k >= 0; k--) {
		double *c = &basis->p[incise_basis_centre(basis, input, k)];

		*c = fmin(*c, bound);
		bound = *c - gap;
	}
}

/* How far function k has to reach: half-way to its neighbours, or to the end. */
static double reach(const struct incise_basis *basis, int input, int k)
{
	double c = basis->p[incise_basis_centre(basis, input, k)];
	double left = c, right = 1 - c;

	if (k > 0)
		left = (c - basis->p[incise_basis_centre(basis, input, k - 1)]) / 2;
	if (k + 1 < basis->n_mfs[input])
		right = (basis->p[incise_basis_centre(basis, input, k + 1)] - c) / 2;
	return fmax(left, right);
}

void incise_premises_project(struct incise_basis *basis)
{
	for (int i = 0; i < basis->n_inputs; i++) {
		double half = spacing(basis, i) / 2;

		order_centres(basis, i);
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			double *p = basis->p + basis->at[i][k], least, most;

			if (basis->type[i][k] == INCISE_MF_GAUSS) {
				least = reach(basis, i, k) /
					sqrt(-2 * log(LEAST_OVERLAP));
				most = MOST_WIDTH * half / sqrt(2 * M_LN2);
			} else {
				p[1] = clamp(p[1], 1, 8);
				least = reach(basis, i, k) /
					pow(1 / LEAST_OVERLAP - 1, 0.5 / p[1]);
				most = MOST_WIDTH * half;
			}
			/* Where a wide gap asks for more than the most, overlap wins. */
			p[0] = fmax(least, fmin(most, p[0]));
		}
	}
}

void incise_premises_step(struct incise_basis *basis, const double *step)
{
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++) {
			int at = basis->at[i][k], c = incise_basis_centre(basis, i, k);

			for (int j = at; j < c; j++)
				basis->p[j] *= exp(step[j]);
			basis->p[c] += step[c] * spacing(basis, i);
		}
	incise_premises_project(basis);
}

void incise_premises_jitter(struct incise_basis *basis, uint64_t seed)
{
	double step[INCISE_MODEL_INPUTS_MAX * INCISE_MODEL_MFS_MAX * BASIS_PARAMS_MAX];

	for (int i = 0; i < basis->n_premises; i++)
		step[i] = JITTER * incise_random(&seed);
	incise_premises_step(basis, step);
}
