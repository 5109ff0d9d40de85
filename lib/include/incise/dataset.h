/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Training data: a table of numbers with named columns, read from CSV. A header row names the
 * columns (with units); one column may be text, the group (cut) of a row. Part of
 * libincise-learn.
 */
#ifndef INCISE_DATASET_H
#define INCISE_DATASET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_dataset;

/**
 * Read the named columns of a CSV file. Fields may be quoted; lines may end in CR LF; a
 * line that starts with '#' and an empty line are ignored.
 *
 * @param path    file, or "-" for standard input
 * @param columns n names; "" matches no column
 * @param group   name of the column with the cut of a row, or NULL
 * @return dataset with the n columns in the order of @columns, to be freed with
 *         incise_dataset_free(); NULL with errno of incise_infile_open() or
 *         incise_infile_line(), EINVAL (a field that is not a finite number, or a row with too
 *         few fields, with line and column in the message; a missing column, with a list of
 *         the existing ones), E2BIG (too many columns), ENODATA (no rows), ENOMEM.
 */
INCISE_API struct incise_dataset *incise_dataset_read(const char *path,
						      const char *const *columns, int n,
						      const char *group,
						      struct incise_error *err);

/**
 * The same without rows that have 0 in one column; their other fields may have any content.
 * All rows are read if the file lacks that column.
 *
 * @param where    name of the column, or NULL for incise_dataset_read()
 * @param left_out set to the number of omitted rows
 * @return as incise_dataset_read(); ENODATA if all rows were omitted
 */
INCISE_API struct incise_dataset *incise_dataset_read_where(
	const char *path, const char *const *columns, int n, const char *group,
	const char *where, size_t *left_out, struct incise_error *err);

/**
 * Whether a CSV file has a column; a file that cannot be read has none.
 *
 * @param stated set to false where its first row has no finite number there; or NULL
 */
INCISE_API bool incise_dataset_has(const char *path, const char *column, bool *stated);

struct ArrowArrayStream;

/**
 * Read columns of an Arrow stream as a dataset, as incise_dataset_read_where() does of CSV.
 * Numbers may be integers, float32, float64 or bool; the group may be text (also as a
 * dictionary) or an integer.
 *
 * @param stream  released in any case
 * @param where   leave out rows whose value in this column is 0; NULL, or a column that the
 *                stream does not have: none
 * @param left_out number of these, or NULL
 * @return as incise_dataset_read_where(); EINVAL also for a null, a value that is not finite, and
 *         a column of another type, named with its row; EIO or the stream's errno if it fails.
 */
INCISE_API struct incise_dataset *incise_dataset_from_arrow(
	struct ArrowArrayStream *stream, const char *const *columns, int n,
	const char *group, const char *where, size_t *left_out, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_dataset_free(struct incise_dataset *data);

/** Number of rows. */
INCISE_API size_t incise_dataset_rows(const struct incise_dataset *data);

/** Row @row: one value per column, in the order of @columns; owned by the dataset. */
INCISE_API const double *incise_dataset_row(const struct incise_dataset *data,
					    size_t row);

/** Group of a row, counted from 0 in order of appearance; -1 without a group column. */
INCISE_API int incise_dataset_group(const struct incise_dataset *data, size_t row);

INCISE_END_DECLS
#endif
