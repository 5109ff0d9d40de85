/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A table on its way into a file or a stream: columns with name, unit and type, rows that are written
 * in blocks, provenance. The format is chosen when the table is opened. Memory is that of one block.
 *
 *     rows ──► block ──► format ──► FILE.csv, FILE.h5, Arrow's arrays
 *     messages ────────► format ──► FILE.mcap
 *
 * Units stand in the columns. Not for several threads.
 */
#ifndef INCISE_TABLE_WRITER_H
#define INCISE_TABLE_WRITER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/error.h>
#include "formats.h"
#include "provenance.h"

#define INCISE_TABLE_BLOCK 16384 /* rows; of HDF5 a chunk, 128 KiB of doubles */
/* From column to column in a block: at a power of two the cells of a row would compete for one place in caches. */
#define INCISE_TABLE_STRIDE (INCISE_TABLE_BLOCK + 8)

/* The type of a value, in a row and in a cell of a block. */
enum incise_column_type {
	INCISE_COLUMN_REAL,   /* double */
	INCISE_COLUMN_SINGLE, /* the same, with seven digits in a binary file */
	INCISE_COLUMN_COARSE, /* the same of an uncertainty, of which twelve bits are kept */
	INCISE_COLUMN_SEEN,    /* double; NaN: missing */
	INCISE_COLUMN_INTEGER, /* int64_t */
	INCISE_COLUMN_SHORT,   /* the same, of 32 bits in a binary file */
	INCISE_COLUMN_FLAG,    /* bool; in a block an integer */
	INCISE_COLUMN_NAME,    /* int64_t of incise_table_name(); in one column only */
	INCISE_COLUMN_TEXT, /* const char *; in a block its place in the table's texts */
};

struct incise_table_column {
	const char *name, *unit, *about; /* unit "1": none */
	enum incise_column_type type;
	int decimals; /* of a real in text; -1: nine digits in all */
	size_t at;    /* of its value in a row, bytes */
	/* An uncertainty names its column, and the rows that share it; else NULL. */
	const char *of, *correlation;
	const struct incise_provenance *calibration; /* that enters the values, or NULL */
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
	bool flag;	  /* of a row … */
	const char *text; /* … that is not in a block */
};

struct incise_table;

/* A format of files or streams. All but close return 0 or a negative errno. */
struct incise_table_format {
	unsigned int abi;
	int (*open)(struct incise_table *table, struct incise_error *err); /* or NULL */
	/* Write the block's rows, table->filled of them; of messages the row of table->stream. */
	int (*put)(struct incise_table *table, struct incise_error *err);
	int (*end)(struct incise_table *table, struct incise_error *err); /* or NULL */
	void (*close)(struct incise_table *table); /* if open made a state */
};

#define INCISE_TABLE_ABI 4 /* changes when a struct of this header does */

struct incise_table {
	/* By the caller; columns and provenance must outlive the table, whose stream stays open. */
	const struct incise_table_format *format;
	FILE *out;
	const struct incise_table_column *columns; /* of rows */
	int n_columns;
	const struct incise_provenance *provenance; /* or NULL */
	struct incise_export_pass *pass;	    /* of messages; see writers.h */

	union incise_cell *block; /* column by column, INCISE_TABLE_STRIDE apart */
	size_t filled;		  /* rows in it */
	uint64_t rows;		  /* in blocks before */
	char **names;
	int n_names;
	char *texts; /* of the block, each with its NUL */
	size_t texts_size, texts_used;
	/* For messages: the streams that open() has opened, and the one that has the present row; see streams.h. */
	struct incise_stream_rows *streams, *stream;
	int n_streams;
	void *state; /* of the format */
};

/* The formats; that of a module is its symbol. */
#define INCISE_TABLE_FORMAT(id, ...) \
	INCISE_API extern const struct incise_table_format incise_table_##id;
INCISE_FORMATS(INCISE_TABLE_FORMAT, INCISE_TABLE_FORMAT)

/* Returns 0 or -errno; then there is nothing to close. */
int incise_table_open(struct incise_table *table, struct incise_error *err);

/* Number of a name, from 1; the last name is not entered twice. Or -ENOMEM. */
int incise_table_name(struct incise_table *table, const char *name);

/* Add a row, a struct with the columns' values. Returns 0 or -errno: ENOSPC, EIO, …. */
int incise_table_add(struct incise_table *table, const void *row,
		     struct incise_error *err);

/* Write the last block and the end of the format; then close. */
int incise_table_finish(struct incise_table *table, struct incise_error *err);

/* Free the memory. */
void incise_table_close(struct incise_table *table);

#endif
