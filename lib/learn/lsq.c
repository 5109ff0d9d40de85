// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Least squares by blockwise QR; see lsq.h.
 *
 *          n   1
 *       ┌────┬───┐
 *       │ R  │ z │  n + 1 rows: the factor of all rows folded in so far
 *       ├────┼───┤
 *       │ A  │ t │  up to BLOCK·n rows waiting
 *       └────┴───┘
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <lapacke.h>
#include "lsq.h"

/* Rows folded in at a time, in multiples of n: more saves little work and takes memory. */
#define BLOCK 4

struct incise_lsq {
	int n;
	int rows;     /* of the buffer, waiting ones included */
	int room;     /* leading dimension */
	double *a;    /* room × (n+1), column-major */
	double *row;  /* n, the next one */
	double *work; /* (2n+1) × (n+1), for solving */
	double *tau;
};

struct incise_lsq *incise_lsq_new(int n)
{
	struct incise_lsq *lsq = calloc(1, sizeof(*lsq));

	if (!lsq)
		return NULL;
	lsq->n = n;
	lsq->room = n + 1 + BLOCK * n;
	lsq->a = malloc((size_t)lsq->room * (n + 1) * sizeof(double));
	lsq->row = malloc(n * sizeof(double));
	lsq->work = malloc((size_t)(2 * n + 1) * (n + 1) * sizeof(double));
	lsq->tau = malloc((n + 1) * sizeof(double));
	if (!lsq->a || !lsq->row || !lsq->work || !lsq->tau) {
		incise_lsq_free(lsq);
		errno = ENOMEM;
		return NULL;
	}
	incise_lsq_reset(lsq);
	return lsq;
}

void incise_lsq_free(struct incise_lsq *lsq)
{
	if (!lsq)
		return;
	free(lsq->a);
	free(lsq->row);
	free(lsq->work);
	free(lsq->tau);
	free(lsq);
}

void incise_lsq_reset(struct incise_lsq *lsq)
{
	lsq->rows = 0;
}

double *incise_lsq_row(struct incise_lsq *lsq)
{
	return lsq->row;
}

/* Keep the upper triangle of a factored matrix: its first n+1 rows. */
static void clear_below(double *a, int ld, int rows, int n)
{
	for (int j = 0; j <= n; j++)
		for (int i = j + 1; i < rows && i <= n; i++)
			a[(size_t)j * ld + i] = 0;
}

static int fold(struct incise_lsq *lsq)
{
	int n = lsq->n;

	if (lsq->rows <= n + 1)
		return 0;
	if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, lsq->rows, n + 1, lsq->a, lsq->room,
			   lsq->tau))
		return -EDOM;
	clear_below(lsq->a, lsq->room, lsq->rows, n);
	lsq->rows = n + 1;
	return 0;
}

int incise_lsq_add(struct incise_lsq *lsq, double target)
{
	int n = lsq->n;

	for (int j = 0; j < n; j++)
		lsq->a[(size_t)j * lsq->room + lsq->rows] = lsq->row[j];
	lsq->a[(size_t)n * lsq->room + lsq->rows] = target;
	return ++lsq->rows < lsq->room ? 0 : fold(lsq);
}

int incise_lsq_solve(struct incise_lsq *lsq, double ridge, double *x)
{
	int n = lsq->n, rc = fold(lsq), rows, ld = 2 * n + 1;

	if (rc)
		return rc;
	/* [R z; √ridge·I 0], factored once more. */
	rows = ridge > 0 ? lsq->rows + n : lsq->rows;
	for (int j = 0; j <= n; j++) {
		double *to = lsq->work + (size_t)j * ld;

		memcpy(to, lsq->a + (size_t)j * lsq->room, lsq->rows * sizeof(double));
		if (ridge <= 0)
			continue;
		memset(to + lsq->rows, 0, n * sizeof(double));
		if (j < n)
			to[lsq->rows + j] = sqrt(ridge);
	}
	if (rows < n)
		return -EDOM;
	if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, rows, n + 1, lsq->work, ld, lsq->tau))
		return -EDOM;
	memcpy(x, lsq->work + (size_t)n * ld, n * sizeof(double));
	if (LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'U', 'N', 'N', n, 1, lsq->work, ld, x, n))
		return -EDOM;
	for (int i = 0; i < n; i++)
		if (!isfinite(x[i]))
			return -EDOM;
	return 0;
}

int incise_lsq_condition(struct incise_lsq *lsq, double *condition)
{
	int n = lsq->n, rc = fold(lsq);
	double *values = lsq->tau, dummy;

	if (rc)
		return rc;
	if (lsq->rows < n) {
		*condition = HUGE_VAL;
		return 0;
	}
	for (int j = 0; j < n; j++)
		memcpy(lsq->work + (size_t)j * lsq->rows, lsq->a + (size_t)j * lsq->room,
		       lsq->rows * sizeof(double));
	if (LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'N', lsq->rows, n, lsq->work, lsq->rows,
			   values, &dummy, 1, &dummy, 1))
		return -EDOM;
	*condition = values[n - 1] > 0 ? values[0] / values[n - 1] : HUGE_VAL;
	return 0;
}
