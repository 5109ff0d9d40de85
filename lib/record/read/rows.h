/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The rows of one of a recording's tables, one after the other. Nothing in the file is
 * trusted: a row that cannot be, or one that is missing, ends it.
 */
#ifndef INCISE_ROWS_H
#define INCISE_ROWS_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include <incise/error.h>
#include "recording.h"
#include "row_times.h"

struct incise_rows {
	struct incise_recording *recording;
	const char *table, *types;
	const char *other;  /* that is joined, or NULL */
	sqlite3_stmt *stmt; /* at the row */
	uint64_t n, expected;
	int64_t t_ns; /* of the row, the best there is; column 1 is its own */
	struct incise_row_times times;
	bool live; /* there is a row */
};

/*
 * Open a table for columns of SQL, the second of which is t_ns, and of these types, a
 * letter each: i integer, r finite real, n the same or NULL, t text. Times increase; those
 * of events may stand still. @expected UINT64_MAX: the table's size is not known. Returns 0
 * or -errno.
 */
int incise_rows_open(struct incise_rows *rows, struct incise_recording *recording,
		     const char *table, const char *columns, const char *types,
		     uint64_t expected, struct incise_error *err);

/* The same with the columns of another table's row of the same number, which must be there. */
int incise_rows_open_joined(struct incise_rows *rows, struct incise_recording *recording,
			    const char *table, const char *other, const char *columns,
			    const char *types, uint64_t expected,
			    struct incise_error *err);

/* Take another calibration's delay; before the first row. */
void incise_rows_calibrate(struct incise_rows *rows,
			   const struct incise_calibration *calibration);

/* Go to the next row: 1, 0 at the end, -EINVAL (a row that cannot be, or missing), -EIO. */
int incise_rows_next(struct incise_rows *rows, struct incise_error *err);

void incise_rows_close(struct incise_rows *rows);

#endif
