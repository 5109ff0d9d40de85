// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Columns of wall time; see writers.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "writers.h"

static const struct incise_table_column tai_columns[INCISE_TAI_COLUMNS] = {
	{"tai_ns", "ns", "TAI since 1970-01-01 00:00:00 TAI", INCISE_COLUMN_INTEGER, 0,
	 NULL, NULL},
	{"tai_u_ns", "ns", "bound of the error of tai_ns; not a number: unknown",
	 INCISE_COLUMN_REAL, 0, NULL, NULL},
};

struct incise_table_column *incise_tai_columns(const struct incise_table_column *columns,
					       int n)
{
	struct incise_table_column *all =
		calloc((size_t)n + INCISE_TAI_COLUMNS, sizeof(*all));

	if (!all)
		return NULL;
	memcpy(all, columns, (size_t)n * sizeof(*all));
	memcpy(all + n, tai_columns, sizeof(tai_columns));
	return all;
}

int incise_tai_cells(const struct incise_wall *wall, int64_t t_ns,
		     union incise_cell cells[INCISE_TAI_COLUMNS],
		     struct incise_error *err)
{
	int64_t tai_ns, u_ns;

	if (incise_wall_tai(wall, t_ns, &tai_ns, &u_ns))
		return incise_error_set(err, ENODATA,
					"at t_ns %lld there is no wall time: its points "
					"are more than 60 s away; export without --tai",
					(long long)t_ns);
	cells[0].integer = tai_ns;
	cells[1].real = u_ns == INCISE_WALL_UNKNOWN ? NAN : (double)u_ns;
	return 0;
}
