/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Samples of one stream as columns, in memory: what readers and the writer of a recording hand on.
 *
 *     seq     t_ns           code          a column for each letter of the form:
 *     ┌─────┐ ┌────────────┐ ┌─────┐         i  int64_t            c  char
 *     │ 120 │ │ 1000000000 │ │ 512 │         r  double, finite     s  char[24], ends with NUL
 *     │ 121 │ │ 1000100000 │ │ 513 │         n  double, or NaN     h  uint8_t[32]
 *     └─────┘ └────────────┘ └─────┘
 */
#ifndef INCISE_BATCH_H
#define INCISE_BATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "ledger.h"

#define INCISE_BATCH_COLUMNS 13

union incise_column {
	int64_t *i;
	double *r;
	char *c;
	char (*s)[INCISE_LEDGER_TEXT + 1];
	uint8_t (*h)[INCISE_FRAMES_DIGEST];
	void *any;
};

struct incise_batch {
	const struct incise_ledger_form *form;
	size_t n, capacity; /* rows */
	union incise_column column[INCISE_BATCH_COLUMNS];
};

/* Rows of a block; more are impossible. */
#define INCISE_BATCH_ROWS_MAX (1 << 16)

/* Room for @n rows in all columns of batch->form. False: no memory; the rows are as before. */
bool incise_batch_reserve(struct incise_batch *batch, size_t n);

void incise_batch_free(struct incise_batch *batch);

/* --- a block of form 5: incise-recording(5) has its bytes ------------------------------- */

/* Bytes that a batch takes at most. */
size_t incise_batch_bound(const struct incise_batch *batch);

/* Write a batch of at least one row to @data of so many bytes; returns how many were used. */
size_t incise_batch_encode(const struct incise_batch *batch, uint8_t *data);

/*
 * Read a block of batch->form with all that makes it whole: its length, its numbers, which increase, and
 * first and last of numbers and times. NULL, or what is wrong, for a message.
 */
const char *incise_batch_decode(struct incise_batch *batch,
				const struct incise_ledger_block *block,
				const uint8_t *data, size_t size);

#endif
