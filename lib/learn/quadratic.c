// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The law a·d + b·d² + c·v + … + e·d·v + … of the first input d and the others, which is 0 where all inputs
 * are, as directions of the consequents of a grid; see crossval.h.
 *
 * A line is the same consequents in all rules. The square has other ones along the first input: those
 * nearest to it over the range. A product has its tangent at the centres of each rule.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "crossval.h"

/* Functions of the first input, at least. */
#define FUNCTIONS_MIN 3

/* Points of the range that the square is fitted at, and the ridge of that. */
#define POINTS 201
#define RIDGE 1e-8

/* A direction that is so near to the others is none. */
#define DEPENDENT 1e-6

/* Consequents (constant, slope) of u² along the first input. */
static int fit_square(const struct incise_basis *basis, double *square)
{
	struct incise_basis line = *basis;
	struct incise_ridge ridge = {.ridge = RIDGE, .n = 2 * basis->n_mfs[0]};
	struct incise_lsq *lsq = incise_lsq_new(ridge.n, NULL);
	double w[INCISE_MODEL_MFS_MAX];
	int rc = lsq ? 0 : -ENOMEM;

	line.n_inputs = 1;
	line.n_rules = basis->n_mfs[0];
	for (int i = 0; i < POINTS && !rc; i++) {
		double u = i / (POINTS - 1.0);

		incise_basis_firing(&line, &u, w);
		incise_basis_row(&line, w, &u, incise_lsq_row(lsq));
		incise_lsq_add(lsq, u * u);
	}
	if (!rc)
		rc = incise_lsq_solve(lsq, &ridge, square);
	incise_lsq_free(lsq);
	return rc;
}

/* Rows of the raw output 0, d, …, d² and d·v, … in scaled consequents; inputs are in units of their scale. */
static void fill_rows(const struct incise_basis *basis, const double *offset,
		      const double *scale, const double *square, double *rows)
{
	int d = basis->n_inputs, n = basis->n_rules * (d + 1);
	double start = offset[0] / scale[0];

	for (int r = 0; r < basis->n_rules; r++) {
		double *line = rows + (size_t)r * (d + 1), *product = line + d * n;
		double deep = 0;

		line[0] = -offset[d] / scale[d];
		for (int i = 0, inner = basis->n_rules; i < d; i++) {
			double from = offset[i] / scale[i], at;
			int k;

			inner /= basis->n_mfs[i];
			k = r / inner % basis->n_mfs[i];
			at = from + basis->p[incise_basis_centre(basis, i, k)];
			deep = i ? deep : at;
			line += n;
			line[0] = from;
			line[i + 1] = 1;
			product += n;
			product[0] = i ? deep * from + at * start - deep * at
				       : start * start + square[2 * k];
			product[1] = i ? at : 2 * start + square[2 * k + 1];
			if (i)
				product[i + 1] = deep;
		}
	}
}

/* Make the row orthogonal to those before it; returns its length. */
static double make_orthogonal(double *rows, int row, int n)
{
	double *own = rows + (size_t)row * n, length = 0;

	for (int k = 0; k < 2 * row; k++) {
		const double *other = rows + (size_t)(k % row) * n;
		double dot = 0;

		for (int i = 0; i < n; i++)
			dot += own[i] * other[i];
		for (int i = 0; i < n; i++)
			own[i] -= dot * other[i];
	}
	for (int i = 0; i < n; i++)
		length = hypot(length, own[i]);
	return length;
}

double *incise_quadratic(const struct incise_basis *basis, const double *offset,
			 const double *scale)
{
	int d = basis->n_inputs, n = basis->n_rules * (d + 1);
	double square[2 * INCISE_MODEL_MFS_MAX];
	bool enough = basis->n_mfs[0] >= FUNCTIONS_MIN;
	double *rows = enough ? calloc((size_t)(2 * d + 1) * n, sizeof(*rows)) : NULL;
	int rc = rows ? fit_square(basis, square) : -ENOMEM;

	if (!rc)
		fill_rows(basis, offset, scale, square, rows);
	for (int row = 0; row < 2 * d && !rc; row++) {
		double length = make_orthogonal(rows + n, row, n);

		if (!(length >= DEPENDENT) || isinf(length))
			rc = -EDOM;
		for (int i = 0; i < n; i++)
			rows[(size_t)(row + 1) * n + i] /= length;
	}
	if (!rc)
		return rows;
	free(rows);
	return NULL;
}
