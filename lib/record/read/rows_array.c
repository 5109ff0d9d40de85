// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a table as an array; see rows_array.h.
 */
#include <errno.h>
#include <stdlib.h>
#include "rows_array.h"

#define ROWS_MAX 100000000 /* of a stream: an hour at 27 kHz */

int incise_rows_array_open(struct incise_rows_array *array,
			   struct incise_recording *recording, const char *table,
			   const char *columns, const char *types, size_t size,
			   struct incise_error *err)
{
	*array = (struct incise_rows_array){.size = size};
	return incise_rows_open(&array->rows, recording, table, columns, types,
				UINT64_MAX, err);
}

void *incise_rows_array_next(struct incise_rows_array *array, int *rc,
			     struct incise_error *err)
{
	*rc = incise_rows_next(&array->rows, err);
	if (*rc <= 0)
		return NULL;
	*rc = 0;
	if (array->n == array->room) {
		int room = array->room ? 2 * array->room : 4096;
		void *list = room <= ROWS_MAX
				     ? realloc(array->list, (size_t)room * array->size)
				     : NULL;

		if (!list) {
			*rc = incise_error_set(err, ENOMEM, "%s: too long for the memory",
					       array->rows.recording->path);
			return NULL;
		}
		array->list = list;
		array->room = room;
	}
	return (char *)array->list + (size_t)array->n * array->size;
}

int incise_rows_array_end(struct incise_rows_array *array, int rc)
{
	incise_rows_close(&array->rows);
	if (rc >= 0 && array->n)
		return array->n;
	free(array->list);
	array->list = NULL;
	return rc;
}
