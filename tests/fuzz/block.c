// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The data of a block of a recording: values of an accepted one are in the ranges of their columns, and they
 * are the same when they are written and read again.
 *
 *     stream │ count (2) │ first_seq, last_seq, first_ns, last_ns (8 each) │ data …
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/record/batch.h"

#define HEAD (1 + 2 + 4 * 8)

static void wrong(const char *what)
{
	fprintf(stderr, "block: %s\n", what);
	abort();
}

static void check_column(char type, const union incise_column *a,
			 const union incise_column *b, size_t n)
{
	for (size_t k = 0; k < n; k++) {
		switch (type) {
		case 'i':
			if (a->i[k] != b->i[k])
				wrong("an integer differs");
			break;
		case 'r':
		case 'n':
			if (type == 'r' ? !isfinite(a->r[k]) : isinf(a->r[k]))
				wrong("a real is not finite");
			if (isnan(a->r[k]) ? !isnan(b->r[k]) : a->r[k] != b->r[k])
				wrong("a real differs");
			break;
		case 'c':
			if (a->c[k] != b->c[k])
				wrong("a character differs");
			break;
		case 's':
			if (a->s[k][INCISE_LEDGER_TEXT] ||
			    memcmp(a->s[k], b->s[k], sizeof(*a->s)) != 0)
				wrong("a text differs, or has no end");
			break;
		default:
			if (memcmp(a->h[k], b->h[k], sizeof(*a->h)) != 0)
				wrong("a digest differs");
		}
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_batch batch = {0}, again = {0};
	struct incise_ledger_block block = {0};
	uint8_t *bytes;
	size_t n;

	if (size < HEAD)
		return 0;
	batch.form = again.form = &incise_ledger_forms[data[0] % INCISE_LEDGER_FORMS];
	block.count = data[1] | data[2] << 8;
	memcpy(&block.first_seq, data + 3, 8);
	memcpy(&block.last_seq, data + 11, 8);
	memcpy(&block.first_ns, data + 19, 8);
	memcpy(&block.last_ns, data + 27, 8);
	if (!incise_batch_decode(&batch, &block, data + HEAD, size - HEAD)) {
		if (batch.n != (size_t)block.count)
			wrong("another number of rows");
		for (size_t k = 0; k < batch.n; k++)
			if (batch.column[0].i[k] < 0 ||
			    (k && batch.column[0].i[k] <= batch.column[0].i[k - 1]))
				wrong("numbers that do not ascend");
		bytes = malloc(incise_batch_bound(&batch));
		n = incise_batch_encode(&batch, bytes);
		if (n > incise_batch_bound(&batch))
			wrong("longer than its bound");
		if (incise_batch_decode(&again, &block, bytes, n))
			wrong("it is not read again");
		for (int i = 0; batch.form->types[i]; i++)
			check_column(batch.form->types[i], &batch.column[i],
				     &again.column[i], batch.n);
		free(bytes);
	} else if (batch.n) {
		wrong("rows of a block that is refused");
	}
	incise_batch_free(&batch);
	incise_batch_free(&again);
	return 0;
}
