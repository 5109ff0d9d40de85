/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The rows of a table as an array, for what is calibrated from a recording: an element for
 * each row that counts.
 */
#ifndef INCISE_ROWS_ARRAY_H
#define INCISE_ROWS_ARRAY_H

#include "rows.h"

struct incise_rows_array {
	struct incise_rows rows; /* at the one that the element is made of */
	void *list;		 /* of n elements; free(3) */
	size_t size;		 /* of an element */
	int n, room;
};

/* Open a table, as rows.h, for elements of that size. 0 or -errno; to be ended in any case. */
int incise_rows_array_open(struct incise_rows_array *array,
			   struct incise_recording *recording, const char *table,
			   const char *columns, const char *types, size_t size,
			   struct incise_error *err);

/*
 * Go to the next row. Its element, behind the last, is there to be filled, and is the array's
 * once n is one more. NULL at the end, and with -errno in @rc.
 */
void *incise_rows_array_next(struct incise_rows_array *array, int *rc,
			     struct incise_error *err);

/* Returns n, or @rc where that is below 0: what failed before. No element, no list: NULL. */
int incise_rows_array_end(struct incise_rows_array *array, int rc);

#endif
