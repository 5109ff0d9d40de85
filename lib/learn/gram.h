/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The exact Gram matrix of rows: Σ vᵢ·vⱼ over all rows, without any rounding. Each element of a
 * row is rounded once, to a multiple of 2⁻⁴⁶ (|v| < 2); every product and every sum after that
 * is an integer.
 *
 * So the result does not depend on the order of the rows, on how they are divided among
 * processes, or on the machine: matrices of parts add up to the matrix of the whole, to the bit,
 * and the matrix of a fold's complement is a difference.
 */
#ifndef INCISE_GRAM_H
#define INCISE_GRAM_H

#include <stddef.h>
#include <stdint.h>
#include "lsq.h"

struct incise_gram;

typedef __int128 incise_gram_sum; /* in units of 2⁻⁹² */

/* Rows that a matrix may have: 2³³ products of less than 4 stay below 2¹²⁷ units. */
#define GRAM_ROWS_MAX (1ULL << 33)

/* For rows of n elements; NULL with errno ENOMEM. */
struct incise_gram *incise_gram_new(int n);
void incise_gram_free(struct incise_gram *gram);
void incise_gram_reset(struct incise_gram *gram);

/* The n elements of the next row, to be filled in: they are not zero. */
double *incise_gram_row(struct incise_gram *gram);

/*
 * Add the row filled in since then. Returns 0; -ERANGE if an element is not between -2 and 2 and
 * -EOVERFLOW beyond GRAM_ROWS_MAX rows: then the row is not added.
 */
int incise_gram_add(struct incise_gram *gram);

uint64_t incise_gram_rows(const struct incise_gram *gram);

/* Add or subtract another matrix of as many elements. Returns 0 or -EOVERFLOW (too many rows). */
int incise_gram_merge(struct incise_gram *gram, struct incise_gram *other);
void incise_gram_subtract(struct incise_gram *gram, struct incise_gram *other);

/*
 * The n·(n+1)/2 sums of the upper triangle, row by row, the caller's to read and, with
 * incise_gram_set_rows(), to replace. Valid until the next use of the matrix.
 */
incise_gram_sum *incise_gram_sums(struct incise_gram *gram);
size_t incise_gram_count(const struct incise_gram *gram);
void incise_gram_set_rows(struct incise_gram *gram, uint64_t rows);

/*
 * Put the triangular factor of a matrix into lsq: of its n rows (w, 1, t), with n - 2 unknowns
 * of lsq as w, a column of ones, and t, for the target (t - mean)/scale. It is the factor that a
 * QR of the rows has, from a Cholesky factorisation in twice the digits of a double. A
 * column that depends on those before it to 2⁻⁹⁰ of its square has a row of zeros. Returns 0 or
 * -ENOMEM.
 */
int incise_gram_factor(struct incise_gram *gram, double mean, double scale,
		       struct incise_lsq *lsq);

/* Σ (w·x - (t - mean)/scale)² over the rows (w, 1, t), for x of n - 2 elements; 0 or above. */
double incise_gram_error(struct incise_gram *gram, double mean, double scale,
			 const double *x);

/* Mean of t of the rows (w, 1, t), and its standard deviation (over n); 0 rows: both 0. */
void incise_gram_target(struct incise_gram *gram, double *mean, double *sd);

#endif
