/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A table of numbers with named columns, read from CSV: the training data. A header row
 * names the columns (with units); one column may hold text, the group (cut) a row
 * belongs to. Part of libincise-learn.
 */
#ifndef INCISE_DATASET_H
#define INCISE_DATASET_H

#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_dataset;

/**
 * Read the named columns of a CSV file. Fields may be quoted; lines may end in CR LF; a
 * line that starts with '#' and an empty line are ignored.
 *
 * @param path    file, or "-" for standard input
 * @param columns n names; "" matches nothing
 * @param group   name of the column whose text names the cut that a row belongs to, or NULL
 * @return dataset with the n columns in the order asked for, to be freed with
 *         incise_dataset_free(); NULL with errno of incise_infile_open() or
 *         incise_infile_line(), EINVAL (a field that is no finite number, a row with too few fields: line and column are named; a column
 *         that does not exist: the ones that do are listed), E2BIG (too many columns),
 *         ENODATA (no rows), ENOMEM.
 */
INCISE_API struct incise_dataset *incise_dataset_read(const char *path,
						      const char *const *columns, int n,
						      const char *group,
						      struct incise_error *err);

/**
 * The same without the rows whose number in one column is 0; what else they hold does not
 * matter. A file without that column is read whole.
 *
 * @param where    name of the column, or NULL for incise_dataset_read()
 * @param left_out how many rows were left out
 * @return as incise_dataset_read(); ENODATA if all rows were left out
 */
INCISE_API struct incise_dataset *incise_dataset_read_where(
	const char *path, const char *const *columns, int n, const char *group,
	const char *where, size_t *left_out, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_dataset_free(struct incise_dataset *data);

/** Number of rows. */
INCISE_API size_t incise_dataset_rows(const struct incise_dataset *data);

/** Row @row: one value per column, in the order asked for; owned by the dataset. */
INCISE_API const double *incise_dataset_row(const struct incise_dataset *data,
					    size_t row);

/** Group of a row, counted from 0 in order of appearance; -1 without a group column. */
INCISE_API int incise_dataset_group(const struct incise_dataset *data, size_t row);

INCISE_END_DECLS
#endif
