// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Normal equations of a delay's few unknowns; see delay.h.
 */
#include <math.h>
#include <lapacke.h>
#include "delay.h"

#define TINY 1e-12

void delay_add_row(struct delay_normal *normal, const double *row, double y)
{
	int m = normal->m;

	for (int i = 0; i < m; i++) {
		normal->b[i] += row[i] * y;
		for (int j = 0; j <= i; j++)
			normal->a[i * m + j] += row[i] * row[j];
	}
	normal->yy += y * y;
}

void delay_add_normal(struct delay_normal *to, const struct delay_normal *from,
		      double times)
{
	for (int i = 0; i < to->m * to->m; i++)
		to->a[i] += times * from->a[i];
	for (int i = 0; i < to->m; i++)
		to->b[i] += times * from->b[i];
	to->yy += times * from->yy;
}

/* Columns are scaled alike first. */
bool delay_solve(const struct delay_normal *normal, double *x)
{
	double a[DELAY_UNKNOWNS * DELAY_UNKNOWNS] = {0}, scale[DELAY_UNKNOWNS];
	int m = normal->m;

	for (int i = 0; i < m; i++) {
		double diagonal = normal->a[i * m + i];

		if (!(diagonal >= 0) || !isfinite(diagonal))
			return false;
		scale[i] = diagonal > 0 ? 1 / sqrt(diagonal) : 0;
	}
	for (int i = 0; i < m; i++) {
		for (int j = 0; j < i; j++)
			a[i * m + j] = normal->a[i * m + j] * scale[i] * scale[j];
		a[i * m + i] = 1 + TINY;
		x[i] = normal->b[i] * scale[i];
	}
	if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', m, 1, a, m, x, 1))
		return false;
	for (int i = 0; i < m; i++)
		x[i] *= scale[i];
	return true;
}
