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

/* Bytes of a value in memory, by the letter of its column. */
size_t incise_batch_size(char type);

/* Room for @n rows in all columns of batch->form. False: no memory; the rows are as before. */
bool incise_batch_reserve(struct incise_batch *batch, size_t n);

void incise_batch_free(struct incise_batch *batch);

#endif
