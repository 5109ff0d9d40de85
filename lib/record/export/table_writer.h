/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A table on its way into a file: columns with name, unit and type, rows that are written in
 * blocks, provenance. The format is chosen when the table is opened. Memory is that of one
 * block.
 *
 *     rows ──► block ──► format ──► outfile ──► FILE.csv, FILE.h5
 *
 * Units stand in the columns. Not for several threads.
 */
#ifndef INCISE_TABLE_WRITER_H
#define INCISE_TABLE_WRITER_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/error.h>
#include "provenance.h"

#define INCISE_TABLE_BLOCK 16384 /* rows; of HDF5 a chunk, 128 KiB of doubles */

enum incise_column_type {
	INCISE_COLUMN_REAL,
	INCISE_COLUMN_SINGLE, /* real, with seven digits in a binary file */
	INCISE_COLUMN_INTEGER,
	INCISE_COLUMN_FLAG, /* integer, 0 or 1 */
	INCISE_COLUMN_NAME, /* integer, from incise_table_name(); in one column only */
};

struct incise_table_column {
	const char *name, *unit, *about; /* unit "1": none */
	enum incise_column_type type;
	int decimals; /* of a real in text; -1: nine digits in all */
	/* Of an uncertainty: the column that it is of, and the rows that share it; else NULL. */
	const char *of, *correlation;
};

/* Names of the uncertainties of a column, with spaces between them, to be freed; NULL: none. */
static inline char *incise_column_uncertainties(const struct incise_table_column *columns,
						int n, int of)
{
	size_t size = 0, used = 0;
	char *text;

	for (int i = 0; i < n; i++)
		if (columns[i].of && !strcmp(columns[i].of, columns[of].name))
			size += strlen(columns[i].name) + 1;
	text = size ? malloc(size) : NULL;
	for (int i = 0; i < n && text; i++)
		if (columns[i].of && !strcmp(columns[i].of, columns[of].name))
			used += (size_t)sprintf(text + used, "%s%s", used ? " " : "",
						columns[i].name);
	return text;
}

union incise_cell {
	double real;
	int64_t integer;
};

struct incise_table;

/* A file format. All but close return 0 or a negative errno. */
struct incise_table_format {
	unsigned int abi;
	int (*begin)(struct incise_table *table, struct incise_error *err);
	/* Write the block's rows, table->filled of them. */
	int (*rows)(struct incise_table *table, struct incise_error *err);
	int (*end)(struct incise_table *table, struct incise_error *err);
	void (*close)(struct incise_table *table); /* if begin made a state */
};

#define INCISE_TABLE_ABI 3 /* changes when a struct of this header does */

struct incise_table {
	const struct incise_table_format *format;
	const struct incise_table_column *columns;
	int n_columns;
	const struct incise_provenance *provenance; /* or NULL */
	union incise_cell *block; /* column by column, INCISE_TABLE_BLOCK each */
	size_t filled;		  /* rows in it */
	uint64_t rows;		  /* in blocks before */
	char **names;
	int n_names;
	FILE *out;
	void *state; /* of the format */
};

extern const struct incise_table_format incise_table_csv;

/* HDF5, from its module; NULL with errno: ENOENT (not built or not found), ENOEXEC. */
const struct incise_table_format *incise_table_hdf5(struct incise_error *err);

/*
 * Open a table on a stream, which the caller closes. Columns and provenance must outlive it.
 * Returns 0 or -errno.
 */
int incise_table_open(struct incise_table *table,
		      const struct incise_table_format *format, FILE *out,
		      const struct incise_table_column *columns, int n_columns,
		      const struct incise_provenance *provenance,
		      struct incise_error *err);

/* Number of a name, from 1; the last name is not entered twice. Or -ENOMEM. */
int incise_table_name(struct incise_table *table, const char *name);

/* Add a row of n_columns cells. Returns 0 or -errno: ENOSPC, EIO, …. */
int incise_table_add(struct incise_table *table, const union incise_cell *cells,
		     struct incise_error *err);

/* Write the last block and the end of the format; then close. */
int incise_table_finish(struct incise_table *table, struct incise_error *err);

/* Free the memory. */
void incise_table_close(struct incise_table *table);

#endif
